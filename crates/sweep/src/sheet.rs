//! The contact sheet: all pictures small, and a plot of any number of a report against any key that is varied.

use std::io::{self, Write};

use serde::Serialize;

use crate::{
    IndexRow, Keep, Status, Store, Value,
    item::{PICTURE, THUMBNAIL},
};

const STYLE: &str = include_str!("../data/sheet.css");
const SCRIPT: &str = include_str!("../data/sheet.js");

/// A page shows no more items than this: each takes some 600 bytes of it, and a dot in its plot.
const MOST_SHOWN: usize = 10_000;

/// Returns n where one in n items is shown, evenly spread over the plan.
pub(crate) fn every(n_items: usize) -> usize {
    n_items.div_ceil(MOST_SHOWN).max(1)
}

/// What a page is made of.
pub(crate) struct Sheet<'a> {
    pub(crate) name: &'a str,
    pub(crate) keys: &'a [&'a str],
    pub(crate) metrics: &'a [String],
    /// All items done, refused and missing.
    pub(crate) counts: [usize; 3],
    /// Those that are shown.
    pub(crate) rows: &'a [IndexRow],
    /// The files that are kept of each item.
    pub(crate) keep: &'a [Keep],
}

/// What the script of the page reads.
#[derive(Serialize)]
struct Content<'a> {
    keys: &'a [&'a str],
    metrics: &'a [String],
    /// The pictures that are shown small and large; none where none is kept.
    small: Option<&'static str>,
    large: Option<&'static str>,
    items: Vec<Item<'a>>,
}

/// An item on the page: number, status, folder, values of the keys, then metrics or the reason.
#[derive(Serialize)]
struct Item<'a>(usize, Status, String, &'a [Value], Vec<Option<f64>>, Option<&'a str>);

impl<'a> Sheet<'a> {
    /// Writes the page, which needs no other file but the pictures beside it.
    pub(crate) fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        let Self { name, keys, metrics, counts: [done, refused, missing], rows, keep } = *self;
        let thumbnail = keep.contains(&Keep::Thumbnail).then_some(THUMBNAIL);
        let picture = keep.contains(&Keep::Picture).then_some(PICTURE);
        let (small, large) = (thumbnail.or(picture), picture.or(thumbnail));
        let content = Content { keys, metrics, small, large, items: rows.iter().map(|row| self.item(row)).collect() };
        // Within a script nothing may end the script.
        let json = serde_json::to_string(&content)?.replace('<', "\\u003c");
        let (name, n_items) = (escaped(name), done + refused + missing);
        let shown = match every(n_items) {
            1 => String::new(),
            n => format!(" · every {n}th is shown here, all are in index.jsonl and index.csv"),
        };
        write!(
            out,
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{name} – dioptric</title>\n\
             <style>\n{STYLE}</style>\n</head>\n<body>\n<header>\n<h1>{name}</h1>\n\
             <p>{n_items} items · {done} done · {refused} refused · {missing} missing{shown}</p>\n</header>\n<main>\n\
             <section>\n<div class=\"choices\">\n<label>metric <select id=\"y\"></select></label>\n\
             <label>against <select id=\"x\"></select></label>\n<label>color <select id=\"color\"></select></label>\n\
             <label><input type=\"checkbox\" id=\"log\"> logarithmic</label>\n</div>\n<div id=\"plot\"></div>\n</section>\n\
             <section>\n<div class=\"choices\">\n<label>order by <select id=\"order\"></select></label>\n\
             <label>show <select id=\"status\"></select></label>\n<span id=\"shown\"></span>\n</div>\n\
             <div id=\"pictures\"></div>\n<button id=\"more\">more</button>\n</section>\n</main>\n\
             <dialog id=\"large\"><img alt=\"\"><p></p></dialog>\n\
             <script type=\"application/json\" id=\"sheet\">{json}</script>\n<script>\n{SCRIPT}</script>\n</body>\n</html>\n",
        )
    }

    fn item(&self, row: &'a IndexRow) -> Item<'a> {
        let of = |name: &String| row.metrics.iter().find(|(own, _)| own == name).map(|(_, number)| *number);
        let numbers = if row.metrics.is_empty() { Vec::new() } else { self.metrics.iter().map(of).collect() };
        // A path in a page has no backslashes.
        let place = Store::place(row.id).to_string_lossy().replace('\\', "/");
        Item(row.item, row.status, place, &row.values, numbers, row.reason.as_deref())
    }
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
