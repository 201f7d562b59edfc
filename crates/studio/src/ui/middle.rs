//! The middle of the window: picture and benches, and the charts beneath.

use std::sync::Arc;

use dioptric_pipeline::{Camera, FocusSpec};
use egui::{Context, TextureOptions, Ui};

use super::{
    Results, Shown, Studio, Tab, Texture, fields,
    views::{self, images, picture},
};
use crate::{
    engine::{Product, Rung},
    session::Snapshot,
};

/// Amplification of the difference of A and B.
const DIFFERENCE_GAIN: f32 = 4.0;

impl Studio {
    pub(super) fn middle(&mut self, ui: &mut Ui, camera: &mut Camera) {
        // What is under the pointer is shown only where there is a picture under it.
        self.hover = None;
        ui.horizontal(|ui| {
            for (tab, name) in [
                (Tab::Picture, "Film"),
                (Tab::LensBench, "Lens bench"),
                (Tab::SensorBench, "Sensor bench"),
                (Tab::CameraFile, "Camera file"),
            ] {
                ui.selectable_value(&mut self.tab, tab, name);
            }
            ui.separator();
            if self.tab == Tab::Picture {
                for (shown, name) in Shown::ALL {
                    ui.selectable_value(&mut self.shown, shown, name);
                }
            }
        });
        match self.tab {
            Tab::Picture => self.picture(ui, camera),
            Tab::LensBench => match &self.lens_answer {
                Some(Ok(answer)) => views::lens_bench::show(ui, answer),
                Some(Err(words)) => fields::wrong(ui, words),
                None => drop(ui.weak("The lens is being analyzed.")),
            },
            Tab::SensorBench => self.sensor_bench(ui),
            Tab::CameraFile => views::camera_file::show(ui, &mut self.camera_text, camera),
        }
    }

    fn sensor_bench(&mut self, ui: &mut Ui) {
        let noise = match &self.sensor_answer {
            Some(Err(words)) => {
                fields::wrong(ui, words);
                None
            }
            Some(Ok(noise)) => Some(noise),
            None => None,
        };
        views::sensor_bench::show(ui, noise, self.edge.as_ref().map(|edge| &edge.response));
    }

    fn picture(&mut self, ui: &mut Ui, camera: &mut Camera) {
        let Some(results) = self.results.clone() else {
            ui.centered_and_justified(|ui| {
                if self.fault.is_none() {
                    ui.spinner();
                }
            });
            return;
        };
        if self.shown == Shown::Irradiance {
            self.wavelengths(ui, &results.product);
        }
        let Some(texture) = self.texture(ui.ctx(), &results) else {
            let words = self.why_no_difference();
            ui.weak(words);
            return;
        };
        let (handle, words) = (texture.handle.clone(), texture.words.clone());
        ui.horizontal(|ui| {
            if ui.button("Fit").on_hover_text("The whole picture (F); a double click does the same").clicked() {
                self.placement = picture::Placement::default();
            }
            if ui
                .button("100 %")
                .on_hover_text("A pixel of the film is a pixel of the screen (1); the wheel zooms, dragging moves")
                .clicked()
            {
                self.placement.zoom = Some(1.0 / ui.ctx().pixels_per_point());
            }
            ui.small(words);
        });
        let place = &results.product.capture.place;
        let film = [place.columns * place.binning, place.rows * place.binning];
        let marks = picture::Marks { cursor: Some(self.cursor), region: self.region };
        let pointed = picture::show(ui, &mut self.placement, &handle, film, &marks);
        self.hover = pointed.hover.and_then(|share| results.product.probe(share));
        if let Some(share) = pointed.click {
            self.cursor = share;
            self.focus_at(share, camera);
        }
        if let Some(share) = pointed.hover.filter(|_| ui.input(|input| input.modifiers.ctrl)) {
            self.cursor = share;
        }
        if pointed.dragged.is_some() {
            self.region = pointed.dragged;
        }
    }

    /// Focuses on what is seen at a place.
    pub(super) fn focus_at(&self, share: [f64; 2], camera: &mut Camera) {
        if let Some(mm) = self.results.as_ref().and_then(|results| results.product.focus_distance_mm(share)) {
            camera.focus = FocusSpec::DistanceMm((10.0 * mm).round() / 10.0);
        }
    }

    fn wavelengths(&mut self, ui: &mut Ui, product: &Product) {
        let (first_nm, last_nm) = product.capture.grid().range_nm();
        ui.horizontal(|ui| {
            ui.spacing_mut().slider_width = 260.0;
            let slider = egui::Slider::new(&mut self.wavelength_nm, first_nm..=last_nm).suffix(" nm").fixed_decimals(0);
            ui.add(slider)
                .accessible_name("wavelength")
                .on_hover_text("The nearest band is shown; the full picture has all of them");
        });
    }

    /// Returns the image that is shown, made now where it is not at hand.
    fn texture(&mut self, context: &Context, results: &Results) -> Option<&Texture> {
        let product = &results.product;
        let address = |product: &Option<Arc<Product>>| product.as_ref().map_or(0, |own| Arc::as_ptr(own).addr() as u64);
        let of_snapshots = || self.snapshots.iter().fold(0, |key: u64, own| key.rotate_left(29) ^ address(own));
        let detail = match self.shown {
            Shown::Irradiance => self.wavelength_nm.to_bits(),
            Shown::Difference => of_snapshots(),
            _ => 0,
        };
        let key = (results.stamp(), self.shown, detail);
        if self.texture.as_ref().is_none_or(|texture| texture.key != key) {
            let (image, words) = match self.shown {
                Shown::Picture => (images::picture(product), String::new()),
                Shown::Raw => (images::raw(product), "raw samples from black to saturation".to_owned()),
                Shown::Irradiance => {
                    let (image, nm) = images::irradiance(product, self.wavelength_nm);
                    (image, format!("irradiance at {nm:.0} nm, full scale its brightest pixel"))
                }
                Shown::Depth => {
                    let (near_m, far_m) = product.depth.range_m();
                    (
                        images::depth(product),
                        format!("depth of the scene, {near_m:.2} m (yellow) to {far_m:.2} m (violet)"),
                    )
                }
                Shown::Difference => {
                    let [Some(a), Some(b)] = &self.snapshots else { return None };
                    // Pictures of two qualities differ by their qualities.
                    if a.rung != b.rung || a.n_samples != b.n_samples {
                        return None;
                    }
                    let image = images::difference(a, b, DIFFERENCE_GAIN)?;
                    let rms = 100.0 * images::difference_rms(a, b)?;
                    let quality = match a.rung {
                        Rung::Full => String::new(),
                        rung => format!(" of {} pictures", rung.name()),
                    };
                    let words =
                        format!("A − B about gray, {DIFFERENCE_GAIN} times{quality}; rms {rms:.2} % of full scale");
                    (image, words)
                }
            };
            let options = TextureOptions { magnification: egui::TextureFilter::Nearest, ..TextureOptions::LINEAR };
            let handle = context.load_texture("picture", image, options);
            self.texture = Some(Texture { key, handle, words });
        }
        self.texture.as_ref()
    }

    /// Says why the difference of A and B is not shown.
    fn why_no_difference(&self) -> String {
        let missing = Snapshot::ALL.into_iter().filter(|which| self.session.snapshot(*which).is_none());
        let missing: Vec<&str> = missing.map(Snapshot::name).collect();
        if !missing.is_empty() {
            return "Keep two pictures as A and B (→A, →B): their difference is shown here.".to_owned();
        }
        if let Some(words) = self.finish.fault(self.session.snapshot(Snapshot::A), self.session.snapshot(Snapshot::B)) {
            return format!("There is no picture of a snapshot: {words}");
        }
        match &self.snapshots {
            [Some(a), Some(b)] if a.rung == Rung::Full && b.rung == Rung::Full => {
                let ([ax, ay], [bx, by]) = (a.size(), b.size());
                format!("A has {ax} × {ay} pixels, B {bx} × {by}: pictures of one size have a difference.")
            }
            _ => "The full pictures of A and B are being taken; their difference is shown when both are there."
                .to_owned(),
        }
    }

    pub(super) fn charts(&mut self, ui: &mut Ui) {
        let Some(results) = self.results.clone() else { return };
        let spread = self.spread.as_ref();
        ui.columns(4, |columns| {
            let [of_spread, of_modulation, of_histogram, of_light] = columns else { return };
            of_spread.strong("Point spread at +");
            views::charts::spread(of_spread, spread.map(|(_, texture)| texture), spread.map(|(spread, _)| spread));
            of_modulation.strong("Modulation at +");
            let capture = &results.product.capture;
            let as_one = capture.frames.exposure.binning.map_or(1, |binning| binning.pixels) as f64;
            let edge = self.edge.as_ref().map(|edge| (&edge.response, as_one * capture.place.pixel_pitch_um()));
            views::charts::modulation(of_modulation, spread.map(|(spread, _)| spread), edge);
            of_histogram.strong("Histogram, raw");
            views::charts::histogram(of_histogram, &results.product);
            of_light.strong("Light");
            views::charts::light(of_light, &results.product);
        });
    }
}
