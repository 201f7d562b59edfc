//! The plots of the report.

use dioptric_optics::glam::DVec2;
use dioptric_psf::{FilmMap, Kernel, LensImage, LensImageModel, Picture};

use super::Run;
use crate::SensorStatistics;
use crate::{Corner, LineChart, Scale, Series, palette};
use dioptric_pipeline::{Capture, REFERENCE_WAVELENGTH_NM, display::wavelength_color};

/// Points of a curve.
const POINTS: usize = 64;

/// The plots of the report.
#[derive(Clone, Debug)]
pub struct RunCharts {
    /// Line spread functions.
    pub lsf: LineChart,
    /// Modulation transfer.
    pub mtf: LineChart,
    /// Relative illumination.
    pub illumination: LineChart,
    /// Distortion.
    pub distortion: LineChart,
    /// Mean spectral irradiance.
    pub spectrum: LineChart,
    /// Digital numbers.
    pub histogram: LineChart,
}

/// The places of the scene that the plots are about.
#[derive(Clone, Debug)]
pub struct RunPlaces {
    /// The field of the film's corner, tangents across and up.
    pub corner: DVec2,
    /// The corner itself, mm from the middle of the film.
    pub corner_mm: DVec2,
    /// The depth in focus, dioptres, moved into the range of the scene.
    pub focus_dioptres: f64,
    /// A few depths from far to near, dioptres.
    pub dioptres: Vec<f64>,
    /// A few wavelengths, nm.
    pub wavelengths_nm: Vec<f64>,
}

impl RunPlaces {
    /// Returns the places of a run.
    pub fn of(run: &Run<'_>) -> Self {
        let (place, scene) = (&run.capture.place, &run.capture.scene);
        let (far, near) = (1.0 / scene.far_m, 1.0 / scene.near_m);
        let steps = if near - far > 1e-6 { 4 } else { 1 };
        let (first, last) = run.capture.grid().range_nm();
        // Four wavelengths from end to end, and the reference in place of the nearest where it is among them.
        let wavelengths_nm =
            (0..4).map(|i| first + (last - first) * f64::from(i) / 3.0).map(f64::round).collect::<Vec<_>>();
        let focus = place.focus_distance_mm.map_or(near, |mm| {
            let pupil_z_mm = run.capture.lens.reference.projection_center_z_mm();
            1e3 / (mm + pupil_z_mm)
        });
        let film = place.film();
        let corner_mm = film.half_size_mm() + film.center_mm.abs();
        let map = run.model.film_map(REFERENCE_WAVELENGTH_NM, corner_mm.length());
        Self {
            corner: seen_towards(&map, corner_mm),
            corner_mm,
            focus_dioptres: focus.clamp(far, near),
            dioptres: (0..steps).map(|i| far + (near - far) * i as f64 / (steps as f64 - 1.0).max(1.0)).collect(),
            wavelengths_nm: if last > first { wavelengths_nm } else { vec![first] },
        }
    }
}

impl RunPlaces {
    /// The size of the largest field of the film, as its tangent.
    pub fn corner_tan(&self) -> f64 {
        self.corner.length()
    }

    /// Returns the field at a share of the way from the axis to the corner.
    pub fn field(&self, share: f64) -> DVec2 {
        share * self.corner
    }
}

impl RunCharts {
    /// Draws up the charts of a run.
    pub fn of(run: &Run<'_>, places: &RunPlaces, sensor: &SensorStatistics) -> Self {
        Self {
            lsf: lsf(run, places),
            mtf: mtf(run, places),
            illumination: illumination(run.model, places),
            distortion: distortion(run.model, places),
            spectrum: spectrum(run.capture),
            histogram: histogram(run.capture, sensor),
        }
    }
}

/// Returns the field that a point of the film sees or, where that is in darkness, the last one on the way to it that is seen.
fn seen_towards(map: &FilmMap, place_mm: DVec2) -> DVec2 {
    let on_the_way = (0..=POINTS).rev().map(|i| place_mm * (i as f64 / POINTS as f64));
    let mut seen = on_the_way.filter(|at_mm| map.irradiance_sr(*at_mm) > 0.0).filter_map(|at_mm| map.field_tan(at_mm));
    seen.next().unwrap_or(DVec2::ZERO)
}

/// Returns the picture of a point about its centroid; all in the middle pixel of a dark one.
fn picture(model: &LensImageModel, field_tan: DVec2, dioptres: f64, wavelength_nm: f64, pitch_um: f64) -> Picture {
    let image = model.point(field_tan, dioptres, wavelength_nm);
    Picture::from(&image.map_or_else(|| Kernel::identity(pitch_um), |image| image.kernel(pitch_um).0))
}

/// Returns the radius of a point's blur of defocus, µm; 0 of a dark one.
fn blur_um(model: &LensImageModel, field_tan: DVec2, dioptres: f64, wavelength_nm: f64) -> f64 {
    let image = model.point(field_tan, dioptres, wavelength_nm);
    image.map_or(0.0, |image| 1e3 * image.blur_radius_mm().abs())
}

/// Line spreads on the axis, in focus, over wavelength.
fn lsf(run: &Run<'_>, places: &RunPlaces) -> LineChart {
    let model = run.model;
    let spreads: Vec<_> = places
        .wavelengths_nm
        .iter()
        .map(|&nm| {
            // As fine as the narrowest line asks for.
            let airy_um = 1e-3 * nm * run.capture.lens.lens.at(nm).map_or(4.0, |l| l.first_order().f_number);
            let blur_um = blur_um(model, DVec2::ZERO, places.focus_dioptres, nm);
            let pitch_um = (0.1 * airy_um).max(0.02 * blur_um);
            (nm, picture(model, DVec2::ZERO, places.focus_dioptres, nm, pitch_um).line_spread(0.0))
        })
        .collect();
    let reach_um = spreads
        .iter()
        .map(|(_, spread)| 2.5 * spread.full_width_at_half_maximum_um())
        .filter(|reach| reach.is_finite())
        .fold(1.0, f64::max);
    let top = spreads.iter().flat_map(|(_, spread)| &spread.values).copied().fold(0.0, f64::max);
    let series = spreads
        .iter()
        .map(|(nm, spread)| Series {
            label: Some(format!("{nm:.0} nm")),
            color: wavelength_color(*nm),
            points: spread
                .at_um
                .iter()
                .zip(&spread.values)
                .filter(|(x, _)| x.abs() <= reach_um)
                .map(|(&x, &y)| (x, y))
                .collect(),
            is_dashed: false,
        })
        .collect();
    LineChart {
        title: "Line spread on the axis, in focus".to_owned(),
        x_label: "x on the film, µm".to_owned(),
        y_label: "share per µm".to_owned(),
        x_range: (-reach_um, reach_um),
        y_range: (0.0, 1.05 * top),
        series,
        legend: Corner::TopRight,
        scale: Scale::Linear,
    }
}

/// Modulation up to the lens's cutoff on the axis and towards the corner, in focus and at the far end, with the Nyquist frequency of the pixels.
fn mtf(run: &Run<'_>, places: &RunPlaces) -> LineChart {
    let nyquist_per_mm = 500.0 / run.capture.place.pitch_um;
    let last_per_mm = cutoff_per_mm(run, places).max(1.1 * nyquist_per_mm);
    let far = places.dioptres[0];
    let (radial, focus) = (places.corner.to_angle(), places.focus_dioptres);
    let tangential = radial + std::f64::consts::FRAC_PI_2;
    let mut lines = vec![
        ("axis, in focus", DVec2::ZERO, focus, 0.0, palette::LINES[0]),
        ("70 % field, radial", places.field(0.7), focus, radial, palette::LINES[1]),
        ("70 % field, tangential", places.field(0.7), focus, tangential, palette::LINES[2]),
    ];
    if (far - places.focus_dioptres).abs() > 1e-6 {
        lines.push(("axis, far end of the scene", DVec2::ZERO, far, 0.0, palette::LINES[6]));
    }
    let mut series: Vec<Series> = lines
        .into_iter()
        .map(|(label, field_tan, dioptres, direction, color)| Series {
            label: Some(label.to_owned()),
            color: color.to_owned(),
            points: modulation(run.model, (field_tan, dioptres), direction, last_per_mm),
            is_dashed: label.ends_with("tangential"),
        })
        .collect();
    series.push(Series {
        label: Some(format!("Nyquist frequency of the pixels, {nyquist_per_mm:.1} per mm")),
        color: palette::REFERENCE.to_owned(),
        points: vec![(nyquist_per_mm, 0.0), (nyquist_per_mm, 1.05)],
        is_dashed: true,
    });
    LineChart {
        title: format!("Modulation of the lens at {REFERENCE_WAVELENGTH_NM:.0} nm, to its cutoff"),
        x_label: "cycles per mm".to_owned(),
        y_label: "modulation".to_owned(),
        x_range: (0.0, last_per_mm),
        y_range: (0.0, 1.05),
        series,
        legend: Corner::TopRight,
        scale: Scale::Linear,
    }
}

/// Returns the frequency beyond which diffraction leaves no modulation on the axis, in focus: 1 / (λ N) by the working f-number.
fn cutoff_per_mm(run: &Run<'_>, places: &RunPlaces) -> f64 {
    let reference = &run.capture.lens.reference;
    let distance_mm = 1e3 / places.focus_dioptres - reference.projection_center_z_mm();
    let distance_mm = if places.focus_dioptres > 0.0 { distance_mm } else { f64::INFINITY };
    let cutoff_per_mm = 1e6 / (REFERENCE_WAVELENGTH_NM * reference.working_f_number(distance_mm));
    if cutoff_per_mm.is_finite() { cutoff_per_mm } else { 0.0 }
}

/// Returns the modulation at frequencies up to the last, those near 0 denser, as far as a picture of the point can hold them.
fn modulation(
    model: &LensImageModel,
    (field_tan, dioptres): (DVec2, f64),
    direction: f64,
    last_per_mm: f64,
) -> Vec<(f64, f64)> {
    // Four pixels a wave; of a wide blur, which has modulation at low frequencies alone, as many pixels as are quick to add up.
    const WIDEST_PX: f64 = 400.0;
    let blur_um = blur_um(model, field_tan, dioptres, REFERENCE_WAVELENGTH_NM);
    let pitch_um = (250.0 / last_per_mm).max(2.0 * blur_um / WIDEST_PX);
    let spot = picture(model, field_tan, dioptres, REFERENCE_WAVELENGTH_NM, pitch_um);
    // The average over a pixel of the picture is not the lens's.
    let along = std::f64::consts::PI * 1e-3 * pitch_um * DVec2::from_angle(direction);
    let sinc = |x: f64| if x == 0.0 { 1.0 } else { x.sin() / x };
    let of_pixel = |per_mm: f64| sinc(along.x * per_mm) * sinc(along.y * per_mm);
    (0..=POINTS)
        .map(|i| last_per_mm * (i as f64 / POINTS as f64).powi(2))
        .take_while(|per_mm| per_mm * pitch_um <= 250.0 * (1.0 + 1e-9))
        .map(|per_mm| (per_mm, spot.mtf(direction, per_mm) / of_pixel(per_mm)))
        .collect()
}

fn over_field(places: &RunPlaces, of: impl Fn(DVec2) -> f64) -> Vec<(f64, f64)> {
    (0..=POINTS)
        .map(|i| places.field(i as f64 / POINTS as f64))
        .map(|tan| (tan.length().atan().to_degrees(), of(tan)))
        .collect()
}

fn illumination(model: &LensImageModel, places: &RunPlaces) -> LineChart {
    let map = model.film_map(REFERENCE_WAVELENGTH_NM, places.corner_mm.length());
    let gain = |tan| map.place_mm(tan).map_or(0.0, |at_mm| map.irradiance_sr(at_mm));
    let axis = gain(DVec2::ZERO);
    let real = over_field(places, |tan| gain(tan) / axis);
    let cosines = over_field(places, |tan| tan.length().atan().cos().powi(4));
    let series = |label: &str, color: &str, points, is_dashed| Series {
        label: Some(label.to_owned()),
        color: color.to_owned(),
        points,
        is_dashed,
    };
    LineChart {
        title: "Relative illumination".to_owned(),
        x_label: "field angle, degrees".to_owned(),
        y_label: "share of the axis".to_owned(),
        x_range: (0.0, places.corner_tan().atan().to_degrees()),
        y_range: (0.0, 1.05),
        series: vec![
            series("this lens", palette::LINES[0], real, false),
            series("cos⁴", palette::REFERENCE, cosines, true),
        ],
        legend: Corner::BottomLeft,
        scale: Scale::Linear,
    }
}

fn distortion(model: &LensImageModel, places: &RunPlaces) -> LineChart {
    let map_at = |nm: f64| model.film_map(nm, places.corner_mm.length());
    let at = |map: &FilmMap, tan: DVec2| map.place_mm(tan).unwrap_or(DVec2::NAN);
    // Heights count from where the axis lands, which a tilted lens moves.
    let reference = map_at(REFERENCE_WAVELENGTH_NM);
    let axis_mm = at(&reference, DVec2::ZERO);
    let small = places.field(1e-3);
    let scale_mm = at(&reference, small).distance(axis_mm) / small.length();
    let curves: Vec<Series> = places
        .wavelengths_nm
        .iter()
        .map(|&nm| {
            let map = map_at(nm);
            let points = over_field(places, |tan| {
                let tan = if tan.length() > small.length() { tan } else { small };
                100.0 * (at(&map, tan).distance(axis_mm) / (scale_mm * tan.length()) - 1.0)
            });
            Series { label: Some(format!("{nm:.0} nm")), color: wavelength_color(nm), points, is_dashed: false }
        })
        .collect();
    let values = || curves.iter().flat_map(|curve| curve.points.iter().map(|p| p.1));
    let (low, high) = (values().fold(0.0, f64::min), values().fold(0.0, f64::max));
    let margin = 0.08 * (high - low).max(0.01);
    LineChart {
        title: "Distortion and lateral color".to_owned(),
        x_label: "field angle, degrees".to_owned(),
        y_label: "image height against f · tan, %".to_owned(),
        x_range: (0.0, places.corner_tan().atan().to_degrees()),
        y_range: (low - margin, high + margin),
        series: curves,
        legend: Corner::BottomLeft,
        scale: Scale::Linear,
    }
}

fn spectrum(capture: &Capture) -> LineChart {
    let points: Vec<(f64, f64)> = capture
        .grid()
        .centers_nm()
        .iter()
        .zip(&capture.irradiance.summary.mean)
        .map(|(&nm, &e)| (nm, 1e3 * e))
        .collect();
    let top = points.iter().map(|p| p.1).fold(0.0, f64::max);
    let (first, last) = capture.grid().range_nm();
    LineChart {
        title: "Mean spectral irradiance on the film".to_owned(),
        x_label: "wavelength, nm".to_owned(),
        y_label: "mW m⁻² nm⁻¹".to_owned(),
        x_range: if last > first { (first, last) } else { (first - 1.0, first + 1.0) },
        y_range: (0.0, 1.05 * top.max(f64::MIN_POSITIVE)),
        series: vec![Series { label: None, color: palette::line(0), points, is_dashed: false }],
        legend: Corner::TopRight,
        scale: Scale::Linear,
    }
}

fn histogram(capture: &Capture, sensor: &SensorStatistics) -> LineChart {
    let series: Vec<Series> = sensor
        .channels
        .iter()
        .map(|channel| {
            let n = channel.histogram.len() as f64;
            let top = capture.frames.exposed.raw.levels.top;
            let center = |bin: usize| (bin as f64 + 0.5) / n * top;
            Series {
                label: Some(channel.filter.clone()),
                color: palette::channel(&channel.filter),
                points: channel
                    .histogram
                    .iter()
                    .enumerate()
                    .map(|(bin, &share)| (center(bin), 100.0 * share))
                    .collect(),
                is_dashed: false,
            }
        })
        .collect();
    let top = series.iter().flat_map(|s| &s.points).map(|p| p.1).fold(0.0, f64::max);
    LineChart {
        title: "Raw frame".to_owned(),
        x_label: "digital number".to_owned(),
        y_label: "pixels of the channel, %".to_owned(),
        x_range: (0.0, capture.frames.exposed.raw.levels.top),
        y_range: (0.0, 1.05 * top.max(f64::MIN_POSITIVE)),
        series,
        legend: Corner::TopRight,
        scale: Scale::Linear,
    }
}
