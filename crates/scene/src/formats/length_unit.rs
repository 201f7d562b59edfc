//! Units of length, as files state them and as names end in them.

/// Returns the metres of a unit of length.
pub(super) fn length_m(unit: &str) -> Option<f64> {
    Some(match unit.to_lowercase().as_str() {
        "m" | "meter" | "meters" | "metre" | "metres" => 1.0,
        "dm" | "decimeter" | "decimeters" | "decimetre" | "decimetres" => 1e-1,
        "cm" | "centimeter" | "centimeters" | "centimetre" | "centimetres" => 1e-2,
        "mm" | "millimeter" | "millimeters" | "millimetre" | "millimetres" => 1e-3,
        "um" | "µm" | "micrometer" | "micrometers" | "micrometre" | "micrometres" => 1e-6,
        "km" | "kilometer" | "kilometers" | "kilometre" | "kilometres" => 1e3,
        "ft" | "foot" | "feet" => 0.3048,
        "inch" | "inches" => 0.0254,
        _ => return None,
    })
}

/// Returns the words of a name, as `inv`, `depth` and `mm` of `invDepth_mm_0001`, in small letters, without those that count files.
pub(super) fn words_of_name(name: &str) -> Vec<String> {
    let is_number = |word: &String| word.chars().all(|c| c.is_ascii_digit());
    all_words(name).into_iter().filter(|word| !is_number(word)).collect()
}

fn all_words(name: &str) -> Vec<String> {
    let mut apart = String::new();
    for c in name.chars() {
        // A capital behind a small letter begins a word.
        if c.is_uppercase() && apart.ends_with(char::is_lowercase) {
            apart.push(' ');
        }
        apart.push(c);
    }
    apart.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()).map(str::to_lowercase).collect()
}

/// Returns the metres of the unit among the words of the name of an array, a channel or a file of depth, as `depth_mm` or
/// `room.depth_meters_0001`: the last; words that may mean something else count at the end alone.
pub(super) fn length_in_name(name: &str) -> Option<f64> {
    const ALSO_OTHERS: [&str; 6] = ["m", "ft", "foot", "feet", "inch", "meter"];
    let words = words_of_name(name);
    let counts = |(index, word): (usize, &String)| {
        let is_last = index + 1 == words.len();
        (is_last || !ALSO_OTHERS.contains(&word.as_str())).then(|| length_m(word)).flatten()
    };
    // Behind a number it is that of something else, as of the focal length in `lens_50_mm_depth`.
    let of_number = all_words(name).windows(3).any(|own| own[0].parse::<f64>().is_ok() && length_m(&own[1]).is_some());
    if words.len() < 2 || of_number { None } else { words.iter().enumerate().rev().find_map(counts) }
}

/// Returns the metres of the one unit of length in words such as `depth in mm`; none of several.
pub(super) fn length_in_words(words: &str) -> Option<f64> {
    let mut found: Vec<f64> = words.split(|c: char| !c.is_alphanumeric()).filter_map(length_m).collect();
    found.dedup();
    Some(found).filter(|found| found.len() == 1).map(|found| found[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_state_units() {
        let of = |name: &str| length_in_name(name);
        assert_eq!([of("depth_mm"), of("a/z-cm"), of("room.depth_meters")], [Some(1e-3), Some(1e-2), Some(1.0)]);
        assert_eq!(
            ["depth_mm_0001", "depthMM", "depth (mm)", "depth[mm]", "depth_mm_raw", "mm_depth", "depthInMillimeters"]
                .map(of),
            [Some(1e-3); 7]
        );
        assert_eq!([of("depth_inches"), of("depth_dm"), of("m_depth")], [Some(0.0254), Some(0.1), None]);
        assert_eq!([of("lens_50_mm_depth"), of("depth_mm_001_b")], [None, Some(1e-3)]);
        assert_eq!([length_in_words("depth [mm] of a film"), length_in_words("m or mm")], [Some(1e-3), None]);
        assert_eq!([of("mm"), of("_mm"), of("depthmm"), of("depth_map"), of("View.Depth.Z")], [None; 5]);
    }
}
