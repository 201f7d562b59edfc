//! Files of text, whatever their encoding, and tables whatever stands between their columns.

use std::{borrow::Cow, fs, io, path::Path};

/// Reads a file of text, as [`of_bytes`] has it.
///
/// # Errors
/// When it cannot be read, or holds what no text does.
pub fn read(path: &Path) -> io::Result<String> {
    let text = of_bytes(&fs::read(path)?);
    if text.contains('\0') {
        return Err(io::Error::new(io::ErrorKind::InvalidData, "it is no text, expected one in UTF-8"));
    }
    Ok(text)
}

/// Returns the text in UTF-8 or UTF-16 (with or without a byte-order mark), or in Latin-1 where it is neither.
///
/// Programs of the last thirty years write all of these. Without a mark, text is taken for UTF-16 where every
/// other byte of its beginning is 0, which holds for no other text. Signs that are broken become `�`.
pub fn of_bytes(bytes: &[u8]) -> String {
    match bytes {
        [0xEF, 0xBB, 0xBF, rest @ ..] => String::from_utf8_lossy(rest).into_owned(),
        [0xFF, 0xFE, rest @ ..] => utf16(rest, u16::from_le_bytes),
        [0xFE, 0xFF, rest @ ..] => utf16(rest, u16::from_be_bytes),
        _ if has_zeros_at(bytes, 1) => utf16(bytes, u16::from_le_bytes),
        _ if has_zeros_at(bytes, 0) => utf16(bytes, u16::from_be_bytes),
        _ => match std::str::from_utf8(bytes) {
            Ok(text) => text.to_owned(),
            Err(_) => bytes.iter().map(|&byte| char::from(byte)).collect(),
        },
    }
}

fn utf16(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> String {
    let units = bytes.as_chunks::<2>().0.iter().map(|&pair| unit(pair));
    char::decode_utf16(units).map(|sign| sign.unwrap_or(char::REPLACEMENT_CHARACTER)).collect()
}

/// Whether of the first pairs of bytes each has a 0 at this place and none at the other.
fn has_zeros_at(bytes: &[u8], place: usize) -> bool {
    let pairs = bytes.as_chunks::<2>().0;
    pairs.len() >= 4 && pairs.iter().take(16).all(|pair| pair[place] == 0 && pair[1 - place] != 0)
}

/// Returns a table with commas between its columns and points in its numbers, line by line, where semicolons or tabs stand between them
/// (then commas may be in the numbers), as spreadsheets of half the world write it.
pub fn with_commas(table: &str) -> Cow<'_, str> {
    // What Excel puts first.
    let (named, rest) = match table.split_once('\n') {
        Some((first, rest)) if first.trim_end().len() == 5 && first.starts_with("sep=") => (first.chars().nth(4), rest),
        _ => (None, table),
    };
    let untitled = without_title(rest);
    let rest = untitled.as_ref();
    let is_between = |sign: char| {
        let mut lines = rest.lines().map(str::trim).filter(|line| !is_comment(line)).peekable();
        lines.peek().is_some() && lines.all(|line| line.contains(sign))
    };
    let Some(between) = [';', '\t'].into_iter().find(|sign| is_between(*sign)) else {
        let table = without_last_sign(rest);
        return if named.is_some() { format!("#\n{table}").into() } else { table.into_owned().into() };
    };
    let cell = |cell: &str| {
        let number = cell.trim().replace(',', ".");
        match number.parse::<f64>() {
            Ok(_) => number,
            Err(_) if cell.contains(',') && !cell.contains('"') => format!("\"{}\"", cell.trim()),
            Err(_) => cell.trim().to_owned(),
        }
    };
    let line = |line: &str| match is_comment(line.trim()) {
        true => line.to_owned(),
        false => line.split(between).map(cell).collect::<Vec<_>>().join(","),
    };
    let start = if named.is_some() { "#\n" } else { "" };
    let table = start.to_owned() + &rest.lines().map(line).collect::<Vec<_>>().join("\n");
    without_last_sign(&table).into_owned().into()
}

/// Whether a line of a table is none of it.
fn is_comment(line: &str) -> bool {
    line.starts_with('#') || line.is_empty()
}

/// Makes a comment of a title, as spreadsheets have it: a first line without what stands between cells, before names of columns.
fn without_title(table: &str) -> Cow<'_, str> {
    let mut lines = table.lines().filter(|line| !is_comment(line.trim()));
    let (Some(title), Some(names)) = (lines.next(), lines.next()) else { return table.into() };
    let Some(between) = [';', '\t', ','].into_iter().find(|sign| names.contains(*sign)) else { return table.into() };
    let first = names.split(between).next().unwrap_or_default().trim().replace(',', ".");
    let is_title = !title.trim_end_matches(between).contains(between)
        && first.parse::<f64>().is_err()
        && lines.next().is_some_and(|line| line.contains(between));
    if is_title { table.replacen(title, &format!("# {title}"), 1).into() } else { table.into() }
}

/// Takes the comma off the ends of lines where all end in one, or all but the first, which has as many cells without.
fn without_last_sign(table: &str) -> Cow<'_, str> {
    let n_signs = |line: &str| line.matches(',').count();
    let mut lines = table.lines().map(str::trim).filter(|line| !is_comment(line));
    let Some(first) = lines.next() else { return table.into() };
    let mut lines = lines.peekable();
    let is_last = |line: &str| line.ends_with(',') && (first.ends_with(',') || n_signs(line) > n_signs(first));
    if lines.peek().is_none() || !lines.all(is_last) {
        return table.into();
    }
    let line = |line: &str| match is_comment(line.trim()) {
        true => line.to_owned(),
        false => {
            let line = line.trim_end();
            line.strip_suffix(',').unwrap_or(line).to_owned()
        }
    };
    table.lines().map(line).collect::<Vec<_>>().join("\n").into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_encoding_gives_the_same_text() {
        let text = "NAME Größe 50\r\nSURF 0\r\n";
        let little: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
        let big: Vec<u8> = text.encode_utf16().flat_map(u16::to_be_bytes).collect();
        let latin: Vec<u8> = text.chars().map(|sign| sign as u8).collect();
        let marked = |mark: &[u8], bytes: &[u8]| [mark, bytes].concat();
        assert_eq!(of_bytes(text.as_bytes()), text);
        assert_eq!(of_bytes(&marked(&[0xEF, 0xBB, 0xBF], text.as_bytes())), text);
        assert_eq!(of_bytes(&marked(&[0xFF, 0xFE], &little)), text);
        assert_eq!(of_bytes(&marked(&[0xFE, 0xFF], &big)), text);
        assert_eq!(of_bytes(&little), text);
        assert_eq!(of_bytes(&big), text);
        assert_eq!(of_bytes(&latin), text);
        assert_eq!(of_bytes(&[0xFF, 0xFE, 0x41]), "");
        assert_eq!(of_bytes(&[]), "");
    }

    #[test]
    fn tables_of_every_spreadsheet_are_the_same() {
        let expected = "# a; b\nnm,a\n450,0.5\n550,1e-3";
        for table in [
            "# a; b\nnm;a\n450;0,5\n550;1e-3\n",
            "# a; b\r\nnm\ta\r\n450\t0.5\r\n550\t1e-3\r\n",
            "# a; b\nnm; a\n450 ; 0,5\n 550;1e-3",
        ] {
            assert_eq!(with_commas(table), expected, "{table:?}");
        }
        assert_eq!(with_commas("sep=;\nnm;a, b\n450;0,5\n"), "#\nnm,\"a, b\"\n450,0.5");
        assert_eq!(with_commas("sep=,\nnm,a\n450,0.5\n"), "#\nnm,a\n450,0.5\n");
        for table in [
            "nm,a;b\n450,0.5\n",
            "450\n",
            "",
            "nm a\n450 0.5\n",
            "nm\n450,1\n550,2\n",
            "a,b\n1,2\n3,\n",
            "a,b\n1,\n3,\n",
        ] {
            assert_eq!(with_commas(table), table);
        }
        // A title, and signs at the ends of lines.
        for table in ["My skin\nnm;a;\n450;0,5;\n550;1e-3;\n", "My skin,,\nnm,a\n450,0.5,\n550,1e-3,\n"] {
            assert_eq!(
                with_commas(table).trim_end_matches(',').replace(",,\n", "\n"),
                "# My skin\nnm,a\n450,0.5\n550,1e-3"
            );
        }
    }
}
