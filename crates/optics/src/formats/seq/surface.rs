//! A surface of a CODE V file.

use crate::{Aperture, Glass, Move, Outline, Shape, prescription::TextError};

use super::super::{
    shapes::{even_asphere, up_to_last},
    system::{SystemMove, SystemSurface},
};

/// A surface as the file states it, in the file's units; the first is the object, the last the image.
#[derive(Default)]
pub(super) struct SeqSurface {
    pub(super) line: usize,
    pub(super) is_stop: bool,
    pub(super) curvature: f64,
    pub(super) thickness: f64,
    pub(super) medium: Option<Glass>,
    pub(super) conic: f64,
    /// From r⁴ on.
    pub(super) coefficients: [f64; 9],
    pub(super) clear_radius: Option<f64>,
    pub(super) opening: SeqOpening,
    pub(super) obscuration: SeqOpening,
    /// What differs along x, where something does.
    pub(super) kind: SeqKind,
    pub(super) curvature_x: f64,
    pub(super) conic_x: f64,
    /// XDE, YDE, ZDE.
    pub(super) decenter: [f64; 3],
    /// ADE, BDE, CDE.
    pub(super) tilt_deg: [f64; 3],
    /// Whether the axis is back in its place behind the surface (DAR).
    pub(super) is_returned: bool,
}

/// An opening or obscuration that is no round rim, in the file's units.
#[derive(Clone, Copy, Default)]
pub(super) struct SeqOpening {
    /// CIR, where it obscures.
    pub(super) radius: Option<f64>,
    /// REX, REY.
    pub(super) rectangle: [Option<f64>; 2],
    /// ELX, ELY.
    pub(super) ellipse: [Option<f64>; 2],
    /// ADX, ADY.
    pub(super) center: [f64; 2],
}

impl SeqOpening {
    /// Returns its shapes.
    fn outlines(&self, mm: f64) -> impl Iterator<Item = Outline> {
        let pair = |[x, y]: [Option<f64>; 2]| Some((x.or(y)? * mm, y.or(x)? * mm));
        let circle = self.radius.map(|radius| Outline::Circle { radius_mm: radius * mm });
        let rectangle = pair(self.rectangle).map(|(half_x_mm, half_y_mm)| Outline::Rectangle { half_x_mm, half_y_mm });
        let ellipse = pair(self.ellipse).map(|(half_x_mm, half_y_mm)| Outline::Ellipse { half_x_mm, half_y_mm });
        [circle, rectangle, ellipse].into_iter().flatten()
    }
}

/// The kinds of surface that CODE V tells apart by a command of their own.
#[derive(Clone, Copy, Default, PartialEq)]
pub(super) enum SeqKind {
    #[default]
    Rotational,
    /// YTO: the curve in the y–z plane turned about an axis parallel to y.
    Toroid,
    /// AAS: a conic each along x and y.
    Biconic,
}

impl SeqSurface {
    /// Returns the tilt and decentre at this surface, if there is one.
    ///
    /// Of the program's angles those about x and y turn by the left-hand rule, that about z by the right-hand rule.
    pub(super) fn own_move(&self, surface: usize, mm: f64, z_mm: f64) -> Option<SystemMove> {
        let [a, b, c] = self.tilt_deg;
        let step = Move {
            surfaces: (surface, if self.is_returned { surface } else { usize::MAX }),
            pivot_mm: 0.0,
            decenter_mm: self.decenter.map(|shift| shift * mm),
            tilt_deg: [-a, -b, c],
            tilt_first: false,
        };
        let is_moved = self.decenter.iter().chain(&self.tilt_deg).any(|&v| v != 0.0);
        is_moved.then_some(SystemMove { z_mm, step })
    }

    pub(super) fn in_mm(&self, mm: f64) -> Result<SystemSurface, TextError> {
        let mut from_r2 = vec![0.0];
        from_r2.extend(self.coefficients.iter().zip(1..).map(|(a, i)| a * mm.powi(-1 - 2 * i)));
        let curvature_x_per_mm = self.curvature_x / mm;
        let conic = self.conic;
        let shape = match self.kind {
            SeqKind::Rotational => even_asphere(conic, &from_r2),
            SeqKind::Toroid => Shape::Toroid { curvature_x_per_mm, conic, coefficients: up_to_last(from_r2) },
            SeqKind::Biconic if self.coefficients.iter().all(|&a| a == 0.0) => {
                Shape::Biconic { conic, curvature_x_per_mm, conic_x: self.conic_x }
            }
            SeqKind::Biconic => {
                let reason = "AAS: higher terms of an anamorphic asphere are not supported".to_owned();
                return Err(TextError { line: Some(self.line), reason });
            }
        };
        let surface = SystemSurface {
            line: self.line,
            curvature_per_mm: self.curvature / mm,
            shape,
            medium_after: self.medium.clone().unwrap_or_default(),
            thickness_after_mm: self.thickness * mm,
            semi_aperture_mm: self.clear_radius.map(|radius| radius * mm),
            is_rim_fixed: self.clear_radius.is_some(),
            apertures: Vec::new(),
        };
        Ok(self.with_apertures(mm, surface))
    }

    /// Returns the surface with the openings and obscurations that the file states for it.
    fn with_apertures(&self, mm: f64, mut surface: SystemSurface) -> SystemSurface {
        let mut opening = self.opening;
        // A circle off the axis is an opening; one about the axis is the rim.
        if opening.center != [0.0; 2] {
            opening.radius = self.clear_radius;
        }
        for (stated, is_obscuration) in [(opening, false), (self.obscuration, true)] {
            let center_mm = stated.center.map(|place| place * mm);
            for outline in stated.outlines(mm) {
                surface = surface.with_aperture(Aperture { surface: 0, outline, center_mm, is_obscuration });
            }
        }
        surface
    }
}
