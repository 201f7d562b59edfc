//! How sensitive a pixel is to the light of its place on the sensor, by the angles from which that comes.

use ndarray::Array2;
use rayon::prelude::*;

use crate::{
    ExitPupil, FrameTable, PixelStack, Sensor, SensorError,
    pixel_stack::{Cone, PixelOptics},
};

/// Nodes of a table over the frame, each way, of a cone of light, over which shares are smooth, and of collimated light, over which they may jump.
const NODES_OF_CONE: usize = 33;
const NODES_OF_COLLIMATED: usize = 129;

/// How sensitive the pixels of a frame are to the light of an exit pupil.
#[derive(Clone, Debug)]
pub struct AngularResponse<'a> {
    sensor: &'a Sensor,
    exit_pupil: Option<ExitPupil>,
    stack: Option<Stack<'a>>,
}

/// A stack, and its share of collimated light along the axis.
#[derive(Clone, Debug)]
struct Stack<'a> {
    stack: &'a PixelStack,
    optics: PixelOptics<'a>,
    axial_share: f64,
}

/// The light on a pixel of a stack.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelLight {
    /// The angle of the chief ray, degrees from the axis.
    pub chief_ray_deg: f64,
    /// The shift of the microlens, µm to the right and down.
    pub microlens_shift_um: [f64; 2],
    /// The share of the light on the opening that reaches the photodiode.
    pub share: f64,
    /// That over the share of collimated light along the axis through a microlens that is not shifted.
    pub factor: f64,
}

impl Sensor {
    /// Returns how sensitive pixels are to the light of an exit pupil, by the chief-ray response or the pixel stack of the data sheet.
    ///
    /// With no pupil light comes collimated along the axis everywhere.
    ///
    /// # Errors
    /// When the sensor or the pupil makes no sense.
    pub fn angular_response(&self, exit_pupil: Option<ExitPupil>) -> Result<AngularResponse<'_>, SensorError> {
        self.check()?;
        exit_pupil.map_or(Ok(()), |pupil| pupil.check())?;
        Ok(self.response_to(exit_pupil))
    }

    /// As [`angular_response`](Self::angular_response), of what is checked.
    pub(crate) fn response_to(&self, exit_pupil: Option<ExitPupil>) -> AngularResponse<'_> {
        let stack = self.pixel_stack.as_ref().map(|stack| {
            let optics = PixelOptics::new(stack, self.opening_um());
            let axial_share = optics.share(&Cone::NORMAL, [0.0; 2]);
            Stack { stack, optics, axial_share }
        });
        AngularResponse { sensor: self, exit_pupil, stack }
    }

    /// Whether the place of a pixel on the sensor changes how it sees light.
    pub fn depends_on_angle(&self) -> bool {
        self.pixel_stack.is_some() || !self.chief_ray_response.is_empty()
    }
}

impl AngularResponse<'_> {
    /// Returns the factor on the electrons of collimated light along the axis at a place, mm to the right of the middle of the frame and down.
    pub fn factor_at_mm(&self, place_mm: [f64; 2]) -> f64 {
        match (&self.stack, self.exit_pupil) {
            (Some(stack), _) => self.light_on(stack, place_mm).factor,
            (None, Some(pupil)) => self.sensor.chief_ray_factor(angle_deg(pupil.chief_slope(place_mm))),
            (None, None) => 1.0,
        }
    }

    /// Returns the light on the photodiode of a pixel at a place, mm as above; `None` of a sensor without a stack.
    pub fn light_at_mm(&self, place_mm: [f64; 2]) -> Option<PixelLight> {
        self.stack.as_ref().map(|stack| self.light_on(stack, place_mm))
    }

    fn light_on(&self, stack: &Stack<'_>, place_mm: [f64; 2]) -> PixelLight {
        let cone = self
            .exit_pupil
            .map_or(Cone::NORMAL, |pupil| Cone { chief: pupil.chief_slope(place_mm), tangent: pupil.cone_tangent() });
        let microlens_shift_um = stack.stack.shift_um(place_mm, cone.chief);
        let share = stack.optics.share(&cone, microlens_shift_um);
        PixelLight {
            chief_ray_deg: angle_deg(cone.chief),
            microlens_shift_um,
            share,
            factor: share / stack.axial_share,
        }
    }

    /// Multiplies each pixel of the planes of a frame by the factor at its middle.
    pub(crate) fn apply(&self, planes: &mut [Array2<f32>]) {
        if self.stack.is_none() && (self.exit_pupil.is_none() || self.sensor.chief_ray_response.is_empty()) {
            return;
        }
        let Some((n_rows, n_columns)) = planes.first().map(|plane| plane.dim()) else { return };
        let place_mm = |row: f64, column: f64| {
            let pitch_mm = 1e-3 * self.sensor.pixel_pitch_um;
            [pitch_mm * (column - 0.5 * (n_columns as f64 - 1.0)), pitch_mm * (row - 0.5 * (n_rows as f64 - 1.0))]
        };
        let share_mm = |down, right| place_mm(down * n_rows as f64 - 0.5, right * n_columns as f64 - 0.5);
        let table = self.table(n_rows * n_columns, share_mm);
        for plane in planes {
            match &table {
                Some(table) => multiply(plane, table),
                None => ndarray::Zip::indexed(plane).par_for_each(|(row, column), value| {
                    *value *= self.factor_at_mm(place_mm(row as f64, column as f64)) as f32;
                }),
            }
        }
    }

    /// Returns the factor over a frame of a stack as a table, unless the frame has no more pixels than that has nodes.
    fn table(&self, n_pixels: usize, place_mm: impl Fn(f64, f64) -> [f64; 2] + Sync) -> Option<FrameTable> {
        self.stack.as_ref()?;
        let is_cone = self.exit_pupil.is_some_and(|pupil| pupil.cone_tangent() > 0.0);
        let nodes = if is_cone { NODES_OF_CONE } else { NODES_OF_COLLIMATED };
        if n_pixels <= nodes * nodes {
            return None;
        }
        let share = |i: usize| i as f64 / (nodes - 1) as f64;
        let node = |node: usize| self.factor_at_mm(place_mm(share(node / nodes), share(node % nodes)));
        let values = (0..nodes * nodes).into_par_iter().map(node).collect();
        Some(FrameTable::new(nodes, nodes, values).expect("as many finite shares as nodes"))
    }
}

/// Multiplies each pixel of a plane by a table over the frame.
fn multiply(plane: &mut Array2<f32>, table: &FrameTable) {
    let (n_rows, n_columns) = plane.dim();
    plane.outer_iter_mut().into_par_iter().enumerate().for_each(|(row, mut values)| {
        let line = table.line((row as f64 + 0.5) / n_rows as f64);
        for (column, value) in values.iter_mut().enumerate() {
            // Cubics may fall below 0 beside a jump.
            *value *= line.at((column as f64 + 0.5) / n_columns as f64).max(0.0) as f32;
        }
    });
}

fn angle_deg([right, down]: [f64; 2]) -> f64 {
    right.hypot(down).atan().to_degrees()
}
