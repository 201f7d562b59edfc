//! The contact sheet: all pictures small, and a plot of any number of a report against any key that is varied.

use serde::Serialize;

use crate::{Index, Status, Store, Value, item::THUMBNAIL};

const STYLE: &str = include_str!("../data/sheet.css");
const SCRIPT: &str = include_str!("../data/sheet.js");

/// What the script of the page reads.
#[derive(Serialize)]
struct Sheet<'a> {
    keys: &'a [String],
    metrics: Vec<&'a str>,
    thumbnail: &'static str,
    items: Vec<Item<'a>>,
}

/// An item on the page: status, folder, values of the keys, then metrics or the reason.
#[derive(Serialize)]
struct Item<'a>(Status, String, &'a [Value], Vec<Option<f64>>, Option<&'a str>);

/// Returns the page, which needs no other file but the pictures beside it.
pub(crate) fn page(index: &Index) -> String {
    let metrics = index.metrics();
    let items = index.rows.iter().map(|row| {
        let of = |name: &&str| row.metrics.iter().find(|(own, _)| own == name).map(|(_, number)| *number);
        let numbers = if row.metrics.is_empty() { Vec::new() } else { metrics.iter().map(of).collect() };
        // A path in a page has no backslashes.
        let place = Store::place(row.id).to_string_lossy().replace('\\', "/");
        Item(row.status, place, &row.values, numbers, row.reason.as_deref())
    });
    let sheet = Sheet { keys: &index.keys, thumbnail: THUMBNAIL, items: items.collect(), metrics: metrics.clone() };
    // Within a script nothing may end the script.
    let json = serde_json::to_string(&sheet).expect("numbers and texts are JSON").replace('<', "\\u003c");
    let count = |status: Status| index.rows.iter().filter(|row| row.status == status).count();
    let name = escaped(&index.name);
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{name} – dioptric</title>\n\
         <style>\n{STYLE}</style>\n</head>\n<body>\n<header>\n<h1>{name}</h1>\n\
         <p>{} items · {} done · {} refused · {} missing</p>\n</header>\n<main>\n\
         <section>\n<div class=\"choices\">\n<label>metric <select id=\"y\"></select></label>\n\
         <label>against <select id=\"x\"></select></label>\n<label>color <select id=\"color\"></select></label>\n\
         <label><input type=\"checkbox\" id=\"log\"> logarithmic</label>\n</div>\n<div id=\"plot\"></div>\n</section>\n\
         <section>\n<div class=\"choices\">\n<label>order by <select id=\"order\"></select></label>\n\
         <label>show <select id=\"status\"></select></label>\n<span id=\"shown\"></span>\n</div>\n\
         <div id=\"pictures\"></div>\n<button id=\"more\">more</button>\n</section>\n</main>\n\
         <script type=\"application/json\" id=\"sheet\">{json}</script>\n<script>\n{SCRIPT}</script>\n</body>\n</html>\n",
        index.rows.len(),
        count(Status::Done),
        count(Status::Refused),
        count(Status::Missing),
    )
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
