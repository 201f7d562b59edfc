//! MATLAB files for tests.

use super::elements;

/// Returns a file of variables.
pub(in super::super) fn mat_file(variables: &[Vec<u8>]) -> Vec<u8> {
    [elements::file_head(), variables.concat()].concat()
}

/// The class of true and false.
pub(in super::super) const LOGICAL_BYTES: u32 = 9 | elements::LOGICAL;

/// Returns a variable of numbers of a class (6 doubles, 7 singles, 9, 11 and 13 whole numbers), the first index fastest.
pub(in super::super) fn variable_of(name: &str, sides: &[usize], class: u32, values: &[f64]) -> Vec<u8> {
    let content = match class {
        6 => elements::doubles(name, sides, values),
        7 => elements::singles(name, sides, values.iter().map(|v| *v as f32)),
        9 => elements::stored(name, sides, (9, 2), &values.iter().map(|v| *v as u8).collect::<Vec<u8>>()),
        LOGICAL_BYTES => {
            elements::stored(name, sides, (LOGICAL_BYTES, 2), &values.iter().map(|v| *v as u8).collect::<Vec<u8>>())
        }
        11 => {
            let bytes: Vec<u8> = values.iter().flat_map(|v| (*v as u16).to_le_bytes()).collect();
            elements::stored(name, sides, (11, 4), &bytes)
        }
        _ => {
            let bytes: Vec<u8> = values.iter().flat_map(|v| (*v as u32).to_le_bytes()).collect();
            elements::stored(name, sides, (13, 6), &bytes)
        }
    };
    elements::variable(&content.unwrap()).unwrap()
}
