//! The widgets of the parameters: each has its label, unit, range and, beside it, what is wrong with it.

use std::ops::RangeInclusive;

use dioptric_pipeline::parse_numbers;
use egui::{Color32, Key, Modifiers, RichText, Slider, TextEdit, Ui};

use super::typed::number_of;

/// Width of labels, points.
const LABEL: f32 = 86.0;
/// Width of a button beside a path, with its margin, points.
const FILE_BUTTON: f32 = 40.0;
/// Width of the text of a number, points.
const NUMBER: f32 = 64.0;

/// A number that is typed, stepped with the arrow keys or dragged along a slider.
pub(super) struct NumberField<'a> {
    /// What it is called.
    pub(super) label: &'a str,
    /// Its unit.
    pub(super) unit: &'a str,
    /// What it may be.
    pub(super) range: RangeInclusive<f64>,
    /// What of it the slider spans; the whole range may be endless.
    pub(super) slider: RangeInclusive<f64>,
    /// Whether equal ways along the slider are equal factors.
    pub(super) is_logarithmic: bool,
    /// What it is, for the tooltip.
    pub(super) words: &'a str,
}

impl<'a> NumberField<'a> {
    /// A number whose slider has equal steps.
    pub(super) fn even(
        label: &'a str,
        unit: &'a str,
        range: RangeInclusive<f64>,
        slider: RangeInclusive<f64>,
        words: &'a str,
    ) -> Self {
        Self { label, unit, range, slider, is_logarithmic: false, words }
    }

    /// A number above 0 whose slider has equal factors.
    pub(super) fn by_factors(
        label: &'a str,
        unit: &'a str,
        range: RangeInclusive<f64>,
        slider: RangeInclusive<f64>,
        words: &'a str,
    ) -> Self {
        Self { label, unit, range, slider, is_logarithmic: true, words }
    }
}

/// What is being typed, and the number that stood there before.
#[derive(Clone)]
struct Typed {
    text: String,
    value: f64,
    wrong: bool,
}

impl NumberField<'_> {
    /// Shows the field; whether the number was changed.
    pub(super) fn show(self, ui: &mut Ui, value: &mut f64) -> bool {
        let before = *value;
        let id = ui.make_persistent_id(("number", self.label));
        let has_focus = ui.memory(|memory| memory.has_focus(id));
        let mut typed = ui
            .data(|data| data.get_temp::<Typed>(id))
            .filter(|typed| has_focus || (typed.wrong && typed.value == *value))
            .filter(|typed| typed.value == *value)
            .unwrap_or_else(|| Typed { text: number_text(*value), value: *value, wrong: false });
        if has_focus {
            let step = |ui: &mut Ui, key| ui.input_mut(|input| input.consume_key(Modifiers::NONE, key));
            let steps = i32::from(step(ui, Key::ArrowUp)) - i32::from(step(ui, Key::ArrowDown));
            if steps != 0 {
                *value = self.stepped(*value, f64::from(steps));
                typed = Typed { text: number_text(*value), value: *value, wrong: false };
            }
        }
        ui.horizontal(|ui| {
            label(ui, self.label);
            let edit = TextEdit::singleline(&mut typed.text).id(id).desired_width(NUMBER).clip_text(false);
            let response = ui.add(edit).on_hover_text(self.tooltip());
            let response = response.accessible_name(self.label);
            if response.changed() {
                match self.parsed(&typed.text) {
                    Some(number) => (*value, typed.wrong) = (number, false),
                    None => typed.wrong = true,
                }
                typed.value = *value;
            }
            ui.weak(self.unit);
            let mut slid = value.clamp(*self.slider.start(), *self.slider.end());
            let slider = Slider::new(&mut slid, self.slider.clone()).show_value(false).logarithmic(self.is_logarithmic);
            ui.spacing_mut().slider_width = (ui.available_width() - 8.0).max(30.0);
            let response = ui.add(slider).on_hover_text(self.tooltip());
            let response = response.accessible_name(format!("{} slider", self.label));
            if response.changed() {
                *value = rounded(slid);
                typed = Typed { text: number_text(*value), value: *value, wrong: false };
            }
        });
        if typed.wrong {
            wrong(ui, &format!("'{}' is no number {}", typed.text.trim(), self.range_words()));
        }
        ui.data_mut(|data| data.insert_temp(id, typed));
        *value != before
    }

    fn parsed(&self, text: &str) -> Option<f64> {
        let number = number_of(text, self.unit)?;
        self.range.contains(&number).then_some(number)
    }

    /// Returns the number so many twentieths of it, or hundredths of the slider, on.
    fn stepped(&self, value: f64, steps: f64) -> f64 {
        let next = match self.is_logarithmic {
            true => value * 1.05_f64.powf(steps),
            false => value + steps * 0.01 * (self.slider.end() - self.slider.start()),
        };
        rounded(next).clamp(*self.range.start(), *self.range.end())
    }

    fn range_words(&self) -> String {
        let (low, high) = (number_text(*self.range.start()), number_text(*self.range.end()));
        let unit = if self.unit.is_empty() { String::new() } else { format!(" {}", self.unit) };
        match self.range.end().is_finite() {
            true => format!("from {low} to {high}{unit}"),
            false => format!("of {low}{unit} or more"),
        }
    }

    fn tooltip(&self) -> String {
        format!(
            "{}\n{}; arrow keys step it; 1/60, 2,8 and 1,500 are read as 1 ÷ 60, 2.8 and 1500",
            self.words,
            self.range_words()
        )
    }
}

/// A choice of words.
pub(super) fn choice<T: PartialEq + Clone>(
    ui: &mut Ui,
    title: &str,
    words: &str,
    value: &mut T,
    options: &[(T, &str)],
) -> bool {
    let before = value.clone();
    ui.horizontal(|ui| {
        label(ui, title);
        let chosen = options.iter().find(|(option, _)| option == value).map_or("other", |(_, name)| *name);
        let width = ui.available_width() - 12.0;
        let shown = egui::ComboBox::new(ui.make_persistent_id(title), "").selected_text(chosen).width(width).show_ui(
            ui,
            |ui| {
                for (option, name) in options {
                    ui.selectable_value(value, option.clone(), *name);
                }
            },
        );
        shown.response.accessible_name(title).on_hover_text(words);
    });
    *value != before
}

/// A choice of variants, whatever they hold; one that is chosen starts as it stands in the list.
pub(super) fn variant<T: Clone>(ui: &mut Ui, title: &str, words: &str, value: &mut T, options: &[(T, &str)]) -> bool {
    let kind = |value: &T| std::mem::discriminant(value);
    let now = options.iter().position(|(option, _)| kind(option) == kind(value)).unwrap_or(options.len());
    let numbers: Vec<(usize, &str)> = options.iter().enumerate().map(|(i, (_, name))| (i, *name)).collect();
    let mut chosen = now;
    let changed = choice(ui, title, words, &mut chosen, &numbers);
    if changed && let Some((option, _)) = options.get(chosen) {
        value.clone_from(option);
    }
    changed
}

/// Something that is so or not.
pub(super) fn tick(ui: &mut Ui, title: &str, words: &str, value: &mut bool) -> bool {
    ui.checkbox(value, title).on_hover_text(words).changed()
}

/// A line of text that means something: what it means, once, where it does; else what is wrong with it stands beneath.
pub(super) fn meaning<T>(
    ui: &mut Ui,
    title: &str,
    words: &str,
    now: &str,
    parse: impl Fn(&str) -> Result<T, String>,
) -> Option<T> {
    let id = ui.make_persistent_id(("meaning", title));
    let mut meant = None;
    if let Some(typed) = text(ui, title, words, now) {
        match parse(&typed) {
            Ok(value) => {
                meant = Some(value);
                ui.data_mut(|data| data.remove_temp::<String>(id));
            }
            Err(error) => ui.data_mut(|data| {
                data.insert_temp(id, error);
            }),
        }
    }
    if let Some(error) = ui.data(|data| data.get_temp::<String>(id)) {
        wrong(ui, &error);
    }
    meant
}

/// A list of numbers, such as `-2, 0, 2` or `400:700:10`.
pub(super) fn numbers(ui: &mut Ui, title: &'static str, words: &str, value: &mut Vec<f64>) -> bool {
    let now = value.iter().map(|number| number_text(*number)).collect::<Vec<_>>().join(", ");
    let parse = |text: &str| parse_numbers(title, text).map_err(|error| error.to_string());
    let typed = meaning(ui, title, words, &now, parse);
    typed.map(|numbers| *value = numbers).is_some()
}

/// A line of text that takes effect when it is left or Enter is pressed; the new text, once.
pub(super) fn text(ui: &mut Ui, title: &str, words: &str, value: &str) -> Option<String> {
    let id = ui.make_persistent_id(("text", title));
    let mut typed = ui.data(|data| data.get_temp::<String>(id)).unwrap_or_else(|| value.to_owned());
    let mut entered = None;
    ui.horizontal(|ui| {
        label(ui, title);
        let response = ui.add(TextEdit::singleline(&mut typed).id(id).desired_width(ui.available_width() - 12.0));
        let response = response.accessible_name(title);
        if response.lost_focus() {
            entered = (typed != value).then(|| typed.trim().to_owned());
            ui.data_mut(|data| data.remove_temp::<String>(id));
        } else if response.has_focus() {
            ui.data_mut(|data| data.insert_temp(id, typed.clone()));
        }
        response.on_hover_text(words);
    });
    entered
}

/// Shows a field and, at its right, a button that chooses a file for it; what the field has, and whether the button was pressed.
pub(super) fn with_choice_of_file<T>(ui: &mut Ui, words: &str, field: impl FnOnce(&mut Ui) -> T) -> (T, bool) {
    ui.horizontal(|ui| {
        let size = egui::vec2(ui.available_width() - FILE_BUTTON, ui.spacing().interact_size.y);
        let inner = ui.allocate_ui(size, field).inner;
        (inner, ui.button("…").on_hover_text(words).clicked())
    })
    .inner
}

/// Tells what is wrong, beneath a field.
pub(super) fn wrong(ui: &mut Ui, words: &str) {
    let color = ui.visuals().error_fg_color;
    ui.horizontal_wrapped(|ui| ui.label(RichText::new(format!("⚠ {words}")).color(color).small()));
}

/// A label of the width of all labels.
pub(super) fn label(ui: &mut Ui, text: &str) {
    let size = egui::vec2(LABEL, ui.spacing().interact_size.y);
    ui.allocate_ui_with_layout(size, egui::Layout::left_to_right(egui::Align::Center), |ui| {
        ui.set_min_width(LABEL);
        ui.add(egui::Label::new(text).truncate().selectable(false));
    });
}

/// Returns a number as it is typed: as few digits as tell it.
pub(super) fn number_text(value: f64) -> String {
    match value {
        v if v == f64::INFINITY => "inf".to_owned(),
        v => format!("{v}"),
    }
}

/// Returns a number of a slider with four significant digits.
fn rounded(value: f64) -> f64 {
    format!("{value:.3e}").parse().unwrap_or(value)
}

/// Colors of lines, told apart also by those who see few (Okabe and Ito).
pub(super) const LINES: [Color32; 6] = [
    Color32::from_rgb(0x00, 0x72, 0xb2),
    Color32::from_rgb(0xd5, 0x5e, 0x00),
    Color32::from_rgb(0x00, 0x9e, 0x73),
    Color32::from_rgb(0xcc, 0x79, 0xa7),
    Color32::from_rgb(0xe6, 0x9f, 0x00),
    Color32::from_rgb(0x56, 0xb4, 0xe9),
];

/// A number that may be left out.
pub(super) fn optional(ui: &mut Ui, field: NumberField<'_>, value: &mut Option<f64>, usual: f64) -> bool {
    let before = *value;
    let mut is_given = value.is_some();
    let title = field.label.to_owned();
    let words = format!("{}; left out, the scene's own or the usual one", field.words);
    if ui.checkbox(&mut is_given, format!("own {title}")).on_hover_text(words).changed() {
        *value = is_given.then_some(usual);
    }
    if let Some(number) = value {
        field.show(ui, number);
    }
    *value != before
}

/// A whole number.
pub(super) fn count(ui: &mut Ui, title: &str, words: &str, range: RangeInclusive<usize>, value: &mut usize) -> bool {
    let mut number = *value as f64;
    let (low, high) = (*range.start() as f64, *range.end() as f64);
    let field = NumberField {
        label: title,
        unit: "",
        range: low..=high,
        slider: low..=high.min(20.0 * number.max(100.0)),
        is_logarithmic: low > 0.0 && high > 1000.0,
        words,
    };
    let changed = field.show(ui, &mut number);
    if changed {
        *value = number.round() as usize;
    }
    changed
}
