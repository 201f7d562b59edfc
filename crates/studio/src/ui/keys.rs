//! What keys and buttons do beyond changing the camera.

use egui::{Key, Modifiers, Ui};

use super::{Studio, Tab, dialog::Purpose, picture};
use crate::session::Snapshot;

/// Half the side of the rectangle that a key marks, as a share of the picture.
const MARKED: f64 = 0.08;

impl Studio {
    /// Takes keys that hold wherever the pointer is, but not while something is typed.
    pub(super) fn keys(&mut self, ui: &Ui) {
        let pressed = |modifiers: Modifiers, key: Key| ui.input_mut(|input| input.consume_key(modifiers, key));
        let redo = pressed(Modifiers::COMMAND | Modifiers::SHIFT, Key::Z) || pressed(Modifiers::COMMAND, Key::Y);
        if redo {
            self.redo();
        } else if pressed(Modifiers::COMMAND, Key::Z) {
            self.undo();
        }
        let files = [
            (Modifiers::COMMAND | Modifiers::SHIFT, Key::S, Purpose::SaveCamera),
            (Modifiers::COMMAND, Key::O, Purpose::Open),
            (Modifiers::COMMAND, Key::P, Purpose::SavePicture),
            (Modifiers::COMMAND, Key::E, Purpose::Export),
        ];
        for (modifiers, key, purpose) in files {
            if pressed(modifiers, key) {
                self.choose(purpose);
            }
        }
        if pressed(Modifiers::COMMAND, Key::S) {
            self.save();
        }
        if ui.memory(|memory| memory.focused()).is_some() {
            return;
        }
        let plain = |key| pressed(Modifiers::NONE, key);
        if plain(Key::Space) {
            self.pause();
        }
        if plain(Key::A) {
            self.recall(Snapshot::A);
        }
        if plain(Key::B) {
            self.recall(Snapshot::B);
        }
        if plain(Key::F) {
            self.placement = picture::Placement::default();
        }
        if plain(Key::Num1) {
            self.placement.zoom = Some(1.0 / ui.ctx().pixels_per_point());
        }
        self.keys_of_picture(ui);
        let tabs = [Tab::Picture, Tab::LensBench, Tab::SensorBench, Tab::CameraFile];
        for (key, tab) in [Key::F1, Key::F2, Key::F3, Key::F4].into_iter().zip(tabs) {
            if plain(key) {
                self.tab = tab;
            }
        }
    }

    /// What the pointer does on the picture: arrows move the cross, Enter focuses there, E marks a rectangle about it, + and − zoom.
    fn keys_of_picture(&mut self, ui: &Ui) {
        let pressed = |modifiers: Modifiers, key: Key| ui.input_mut(|input| input.consume_key(modifiers, key));
        for (modifiers, step) in [(Modifiers::NONE, 0.01), (Modifiers::SHIFT, 0.1)] {
            for (key, axis, sign) in [
                (Key::ArrowLeft, 0, -1.0),
                (Key::ArrowRight, 0, 1.0),
                (Key::ArrowUp, 1, -1.0),
                (Key::ArrowDown, 1, 1.0),
            ] {
                if pressed(modifiers, key) {
                    self.cursor[axis] = (self.cursor[axis] + sign * step).clamp(0.0, 1.0);
                }
            }
        }
        if pressed(Modifiers::NONE, Key::Enter) {
            let mut camera = self.session.camera().clone();
            self.focus_at(self.cursor, &mut camera);
            self.take(camera, None);
        }
        if pressed(Modifiers::NONE, Key::E) {
            let [x, y] = self.cursor;
            self.region = Some([[x - MARKED, y - MARKED], [x + MARKED, y + MARKED]]);
        }
        for (key, factor) in [(Key::Plus, 1.25), (Key::Equals, 1.25), (Key::Minus, 0.8)] {
            if pressed(Modifiers::NONE, key) {
                self.placement.zoom_by(factor, self.cursor);
            }
        }
    }

    pub(super) fn undo(&mut self) {
        self.keep_now();
        if self.session.undo() {
            self.submit();
        }
    }

    pub(super) fn redo(&mut self) {
        self.keep_now();
        if self.session.redo() {
            self.submit();
        }
    }

    pub(super) fn recall(&mut self, which: Snapshot) {
        self.keep_now();
        if self.session.recall(which) {
            self.submit();
        }
    }

    pub(super) fn pause(&mut self) {
        self.is_paused = !self.is_paused;
        if self.is_paused {
            self.engine.stop();
        } else {
            self.submit();
        }
    }
}
