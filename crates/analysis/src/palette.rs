//! Colors of lines that all eyes tell apart.

/// Colors of lines in a chart, in the order in which they are taken: six of Okabe and Ito (Color Universal Design, 2008), their black made a
/// dark gray, and two more at least as far from all others under each deficiency of color vision.
pub(crate) const LINES: [&str; 9] =
    ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#333333", "#773300", "#3300bb"];

/// Of lines that others are compared with.
pub(crate) const REFERENCE: &str = "#999999";

/// Returns the color of the i-th line.
pub fn line(i: usize) -> String {
    LINES[i % LINES.len()].to_owned()
}

/// Returns the color of the line of a channel: a red, green or blue that stay apart where red and green do not.
pub(crate) fn channel(name: &str) -> String {
    let place = match name.chars().next().map(|first| first.to_ascii_lowercase()) {
        Some('r') => 1,
        Some('g') => 2,
        Some('b') => 0,
        _ => 6,
    };
    LINES[place].to_owned()
}

#[cfg(test)]
mod tests {
    use dioptric_spectrum::{Lab, Xyz, srgb_decode};

    use super::*;

    /// Linear sRGB as it is seen without one kind of cones, and with all: Machado, Oliveira & Fernandes 2009, table 1, severity 1.
    const EYES: [(&str, [[f64; 3]; 3]); 4] = [
        ("all cones", [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
        (
            "no L cones",
            [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
        ),
        (
            "no M cones",
            [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
        ),
        (
            "no S cones",
            [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
        ),
    ];

    /// A color of the web as an eye sees it.
    fn seen(color: &str, eye: &[[f64; 3]; 3]) -> Lab {
        let code = |i: usize| f64::from(u8::from_str_radix(&color[1 + 2 * i..3 + 2 * i], 16).unwrap()) / 255.0;
        let linear = [0, 1, 2].map(|i| srgb_decode(code(i)));
        let seen = eye.map(|row| (0..3).map(|i| row[i] * linear[i]).sum::<f64>().clamp(0.0, 1.0));
        Xyz::from_linear_srgb(seen).to_lab(Xyz::from_linear_srgb([1.0; 3]))
    }

    #[test]
    fn every_eye_tells_lines_apart() {
        for (name, eye) in &EYES {
            for (i, one) in LINES.iter().enumerate() {
                for other in &LINES[..i] {
                    let (a, b) = (seen(one, eye), seen(other, eye));
                    let apart = ((a.l - b.l).powi(2) + (a.a - b.a).powi(2) + (a.b - b.b).powi(2)).sqrt();
                    // Thin lines are distinguishable from some 10 on; 16.1 is the least, of green and light blue without S cones.
                    assert!(apart > 15.0, "{one} and {other} are {apart:.1} apart with {name}");
                }
            }
        }
    }

    #[test]
    fn channels_have_colors_of_their_names() {
        assert_eq!(["R", "green", "B", "W"].map(channel), [1, 2, 0, 6].map(line));
    }
}
