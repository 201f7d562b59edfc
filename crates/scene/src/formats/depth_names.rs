//! What names and words say of a depth, whatever bears them: an array, a channel, a file, an attribute.

use super::length_unit::length_m;

/// What words say of the numbers of a depth.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct SaidOfDepth {
    /// The length of 1, m, where they name one unit of length.
    pub(super) unit_m: Option<f64>,
    /// Whether distances are counted from the camera, or along its axis.
    pub(super) is_radial: Option<bool>,
    /// What is asked for where the numbers are no lengths of a known unit.
    pub(super) lacks: Option<&'static str>,
    /// Whether they name a depth or a distance.
    pub(super) is_of_depth: bool,
    /// Whether they have a number with a unit of length, as `lens_50_mm`, which may be that of a lens, of a place or of a step.
    pub(super) has_length: bool,
}

const DEPTHS: [&str; 4] = ["depth", "depths", "depthmap", "z"];
const DISTANCES: [&str; 3] = ["distance", "distances", "dist"];
const RAYS: [&str; 12] = [
    "ray",
    "rays",
    "raydepth",
    "raylength",
    "raydistance",
    "radial",
    "euclidean",
    "slant",
    "slantrange",
    "spherical",
    "sight",
    "range",
];
/// What a file of numbers is called beside what they are.
const OF_FILES: [&str; 8] = ["map", "maps", "image", "img", "pass", "frame", "raw", "data"];
const MIST: &str = "its name says that it is a mist, whose numbers are no lengths: expected the pass of depth (Z), or --depth-unit or --depth-kind";
const INVERSE: &str = "its name or words say that it holds disparities or inverse distances: expected --depth-kind, as disparity:BASELINE_M or inverse";
const BUFFER: &str = "its name or words say that it is a depth buffer or holds normalized device coordinates, and no lengths: expected \
                      --depth-kind buffer:NEAR_M,FAR_M (numbers from 0 to 1) or ndc:NEAR_M,FAR_M (from -1), or lengths and their --depth-unit";
/// What stands beside the word of a depth that has another meaning than a length: of buffers, of inverses and of shares.
const OF_BUFFERS: [&str; 14] = [
    "buffer",
    "buf",
    "ndc",
    "gl",
    "opengl",
    "hw",
    "hardware",
    "nonlinear",
    "projective",
    "reversed",
    "reverse",
    "hdrp",
    "urp",
    "unorm",
];
/// Where a renderer counts depths that are no lengths; names of files may be of such things.
const OF_SPACES: [&str; 4] = ["clip", "device", "window", "screen"];
const OF_INVERSES: [&str; 13] = [
    "inv",
    "rcp",
    "recip",
    "reciprocal",
    "inverted",
    "nearness",
    "closeness",
    "diopter",
    "diopters",
    "dioptre",
    "dioptres",
    "dpt",
    "idepth",
];
const OF_SHARES: [&str; 17] = [
    "log",
    "log2",
    "log10",
    "ln",
    "sqrt",
    "logarithm",
    "logarithmic",
    "rel",
    "relative",
    "norm",
    "normalized",
    "normalised",
    "ordinal",
    "unscaled",
    "scaleless",
    "affine",
    "invariant",
];
/// Programs that guess depths without a scale.
const OF_GUESSES: [&str; 4] = ["midas", "marigold", "leres", "depthanything"];
const RELATIVE: &str = "its name or words say that its numbers are relative, or logarithms, and no lengths: expected lengths, or --depth-unit or --depth-kind";

impl SaidOfDepth {
    /// Of the name of an array or a channel, the last of a path.
    pub(super) fn of_name(name: &str) -> Self {
        Self::of(name.rsplit('/').next().unwrap_or(name))
    }

    /// Of what a file says of an array.
    pub(super) fn of(words: &str) -> Self {
        let own = words_of(words);
        let has = |known: &[&str]| own.iter().any(|word| known.contains(&word.as_str()));
        let radial = has(&RAYS) || has(&DISTANCES) || has(&["perspective"]);
        let is_axial =
            has(&["axial", "axis", "planar", "perpendicular"]) || has_pair(&own, &["image", "to"], &["plane"]);
        let is_radial = if is_axial { Some(false) } else { radial.then_some(true) };
        Self {
            unit_m: unit_of(&own),
            is_radial,
            lacks: lacks(&own).or_else(|| {
                let is_inverse = ["1/m", "1/z", "1/depth", "m-1", "m^-1", "m⁻¹"].iter().any(|unit| {
                    words.split([' ', '(', ')', '[', ']', ',', ':']).any(|word| word.eq_ignore_ascii_case(unit))
                });
                is_inverse.then_some(INVERSE).or(has_pair(&own, &OF_SPACES, &DEPTHS).then_some(BUFFER))
            }),
            is_of_depth: has(&DEPTHS) || has(&DISTANCES),
            has_length: (0..own.len()).any(|i| is_counted(&own, i)),
        }
    }

    /// Of the stem of a file, which may be called after what it shows.
    pub(super) fn of_file(stem: &str) -> Self {
        let own = words_of(stem);
        let has = |known: &[&str]| own.iter().any(|word| known.contains(&word.as_str()));
        let is_last = |known: &[&str]| {
            let mut words = own
                .iter()
                .filter(|word| length_m(word).is_none() && !is_number(word) && !OF_FILES.contains(&word.as_str()));
            words.next_back().is_some_and(|word| known.contains(&word.as_str()))
        };
        const LENGTHS: [&str; 7] = ["depth", "depths", "distance", "distances", "dist", "length", "lengths"];
        let is_axial = has(&["axial", "planar"]) || has_pair(&own, &["image", "to"], &["plane"]);
        let radial = has(&["radial", "euclidean", "raydepth", "raylength", "raydistance", "slantrange"])
            || is_last(&DISTANCES)
            || is_last(&["range"])
            || has_pair(&own, &DISTANCES, &["to", "from"])
            || has_pair(&own, &DEPTHS, &["perspective"])
            || has_pair(&own, &["perspective"], &DEPTHS)
            || has_pair(&own, &["spherical"], &DEPTHS)
            || has_pair(&own, &["along"], &["ray", "rays"])
            || has_pair(&own, &["ray"], &LENGTHS)
            || has_pair(&own, &LENGTHS, &["ray"]);
        let is_radial = if is_axial { Some(false) } else { radial.then_some(true) };
        Self {
            unit_m: unit_of(&own),
            is_radial,
            lacks: lacks(&own),
            is_of_depth: has(&DEPTHS) || has(&DISTANCES),
            has_length: (0..own.len()).any(|i| is_counted(&own, i)),
        }
    }
}

/// Whether the name of a file may be that of a depth buffer, or of what it shows.
pub(super) fn may_be_of_a_buffer(file: &str) -> bool {
    has_pair(&words_of(file), &OF_SPACES, &DEPTHS)
}

/// Whether an array is called so, whatever unit of length and number stand with it, as in `depth_mm`.
pub(super) fn is_called(name: &str, wanted: &str) -> bool {
    let bare = |name: &str| -> Vec<String> {
        words_of(name).into_iter().filter(|word| length_m(word).is_none() && !is_number(word)).collect()
    };
    name.eq_ignore_ascii_case(wanted) || bare(name) == bare(wanted)
}

/// Returns the words of a name, as `inv`, `depth` and `mm` of `invDepth_mm`, in small letters.
pub(super) fn words_of(name: &str) -> Vec<String> {
    let mut apart = String::new();
    let all: Vec<char> = name.chars().collect();
    for (i, c) in all.iter().enumerate() {
        // A capital behind a small letter begins a word, and so does the last one of several, as in HDRPDepth.
        let is_behind_capitals = || {
            let is_small = all.get(i + 1).is_some_and(|next| next.is_lowercase());
            is_small && i > 1 && all[i - 2..i].iter().all(|before| before.is_uppercase())
        };
        if c.is_uppercase() && (apart.ends_with(char::is_lowercase) || is_behind_capitals()) {
            apart.push(' ');
        }
        apart.push(*c);
    }
    let words = apart.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()).map(str::to_lowercase);
    // What is said of a depth may stand without a gap, as in depthmm and invz.
    let is_said = |rest: &str| [&OF_BUFFERS[..], &OF_INVERSES, &OF_SHARES].iter().any(|known| known.contains(&rest));
    let parts = |word: String| {
        let apart = ["depth", "z"].iter().find_map(|name| {
            let behind = word.strip_prefix(name).filter(|rest| length_m(rest).is_some() || is_said(rest));
            let before = word.strip_suffix(name).filter(|rest| is_said(rest));
            behind.map(|rest| [*name, rest]).or(before.map(|rest| [rest, *name])).map(|parts| parts.map(str::to_owned))
        });
        apart.map_or_else(|| vec![word.clone()], Vec::from)
    };
    words.flat_map(parts).collect()
}

fn is_number(word: &str) -> bool {
    word.chars().all(|c| c.is_ascii_digit())
}

/// Whether one of some words stands before one of others.
fn has_pair(words: &[String], first: &[&str], second: &[&str]) -> bool {
    words.windows(2).any(|pair| first.contains(&pair[0].as_str()) && second.contains(&pair[1].as_str()))
}

/// Whether a word is a unit of length behind a number that counts it, and not frames, as `0001` does.
fn is_counted(words: &[String], i: usize) -> bool {
    let is_frame = |word: &str| word.len() > 1 && word.starts_with('0');
    let (number, unit) = words[i].split_at(words[i].find(|c: char| !c.is_ascii_digit()).unwrap_or(0));
    match number {
        "" => length_m(unit).is_some() && i > 0 && is_number(&words[i - 1]) && !is_frame(&words[i - 1]),
        number => length_m(unit).is_some() && !is_frame(number),
    }
}

/// Returns the metres of the one unit of length among some words, beside others; a unit behind a number is of what it counts, as in `lens_50_mm`.
fn unit_of(words: &[String]) -> Option<f64> {
    let units = (0..words.len()).filter(|i| words.len() > 1 && !is_counted(words, *i));
    let mut found: Vec<f64> = units.filter_map(|i| length_m(&words[i])).collect();
    found.dedup();
    Some(found).filter(|found| found.len() == 1).map(|found| found[0])
}

fn lacks(words: &[String]) -> Option<&'static str> {
    let is = |known: &[&str]| words.iter().any(|word| known.contains(&word.as_str()));
    let is_disparity = |word: &String| {
        let rest = word.strip_prefix("disp");
        word.contains("disparit")
            || ["sgbm", "parallax"].contains(&word.as_str())
            || rest.is_some_and(|rest| rest == "map" || is_number(rest))
    };
    if is(&["mist"]) {
        return Some(MIST);
    }
    let beside_depth = |known: &[&str]| has_pair(words, known, &DEPTHS) || has_pair(words, &DEPTHS, known);
    let is_buffer = is(&["ndc"])
        || beside_depth(&OF_BUFFERS)
        || has_pair(words, &DEPTHS, &["texture"])
        || has_pair(words, &["non"], &["linear"])
        || has_pair(words, &OF_SPACES, &["space"]);
    if is_buffer {
        return Some(BUFFER);
    }
    let is_over = words
        .windows(3)
        .any(|own| ["1", "one"].contains(&own[0].as_str()) && own[1] == "over" && DEPTHS.contains(&own[2].as_str()));
    if words.iter().any(|word| is_disparity(word) || word.contains("inverse")) || is(&OF_INVERSES) || is_over {
        return Some(INVERSE);
    }
    let is_relative = beside_depth(&OF_SHARES)
        || has_pair(words, &OF_SHARES, &DISTANCES)
        || has_pair(words, &["to"], &["scale"])
        || words.last().is_some_and(|word| word == "relative")
        // Capitals within the names of programs part them.
        || (1..=3).any(|n| words.windows(n).any(|own| OF_GUESSES.contains(&own.concat().as_str())));
    is_relative.then_some(RELATIVE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_state_units() {
        for of in [SaidOfDepth::of, SaidOfDepth::of_file] {
            for name in [
                "depth_mm",
                "z-mm",
                "depth.mm",
                "depthMM",
                "depth (mm)",
                "depth[mm]",
                "depth_mm_raw",
                "mm_depth",
                "depthmm",
                "Zmm",
                "depthInMillimeters",
                "depth_mm_0001",
                "0001_depth_mm",
                "frame12.depth_mm",
                "depth_0001_mm",
            ] {
                assert_eq!(of(name).unit_m, Some(1e-3), "{name}");
            }
            for name in ["mm", "_mm", "depth_map", "View.Depth.Z", "m_or_mm", "lens_50_mm_depth", "50mm_depth"] {
                assert_eq!(of(name).unit_m, None, "{name}");
            }
            for (name, has_length) in [
                ("lens_50_mm_depth", true),
                ("50mm_depth", true),
                ("depth_0.5_m", true),
                ("depth_2_mm_x", true),
                ("depth_0001_mm", false),
                ("depth_2_x", false),
                ("depth_12", false),
            ] {
                assert_eq!(of(name).has_length, has_length, "{name}");
            }
            assert_eq!(
                [of("depth_inches"), of("depth_dm"), of("z_feet")].map(|own| own.unit_m),
                [0.0254, 0.1, 0.3048].map(Some)
            );
        }
    }

    #[test]
    fn words_state_what_is_counted() {
        let both = |name: &str| [SaidOfDepth::of(name), SaidOfDepth::of_file(name)].map(|own| own.is_radial);
        for name in [
            "distance",
            "distance_0001",
            "distance.0001",
            "range_0001",
            "radial_depth",
            "ray_depth",
            "depthRay",
            "ray_length",
            "euclidean_distance",
            "distance_to_camera",
            "dist_to_camera",
            "img_0_DepthPerspective",
            "distance_mm",
            "raydepth",
            "slantrange_mm",
            "distance_map",
            "range_image_0001",
            "rangeMap",
            "perspective_depth",
            "raylength",
            "depth_along_ray",
            "spherical_depth",
        ] {
            assert_eq!(both(name), [Some(true); 2], "{name}");
        }
        for name in ["depth", "z", "depth_0001", "depth_arranged", "X-ray.room"] {
            assert_eq!(SaidOfDepth::of_file(name).is_radial, None, "{name}");
        }
        for name in ["distance_to_image_plane", "distance_to_plane", "depth_planar", "img_0_DepthPlanar"] {
            assert_eq!(both(name), [Some(false); 2], "{name}");
        }
        assert_eq!(SaidOfDepth::of("distance along the optical axis").is_radial, Some(false));
        assert_eq!(SaidOfDepth::of("distance from the camera").is_radial, Some(true));
    }

    #[test]
    fn words_state_what_is_no_length() {
        for name in [
            "disparity",
            "disp",
            "disp0",
            "dispmap",
            "disparities_12",
            "inv_depth",
            "depth_inv",
            "depthinv",
            "idepth",
            "inverse_depth",
            "inverseDepth",
            "diopters",
            "log_depth",
            "logdepth",
            "relative_depth",
            "depth_norm",
            "Mist",
            "ndc_depth",
            "depthNDC",
            "zbuffer",
            "depth_buffer_0001",
            "zBuffer",
            "depth_buf",
            "gl_depth",
            "depth_nonlinear",
            "non-linear depth",
            "projective_depth",
            "reversedZ",
            "reversed_z",
            "_CameraDepthTexture",
            "HDRPDepth",
            "screen_space_depth",
            "invz",
            "zinv",
            "one_over_z",
            "rcp_depth",
            "recipDepth",
            "nearness",
            "closeness",
            "depth_unscaled",
            "depth_up_to_scale",
            "affine_invariant_depth",
            "ln_depth",
            "log10_depth",
            "sqrt_depth",
            "midas_0001",
            "MiDaS_out",
            "LeReS",
            "adabins_relative",
            "depth_anything_v2",
        ] {
            assert!(SaidOfDepth::of(name).lacks.is_some() && SaidOfDepth::of_file(name).lacks.is_some(), "{name}");
        }
        for words in ["clip_z", "deviceDepth", "window depth", "inverse depth (1/m)", "depth [m-1]", "1/z"] {
            assert!(SaidOfDepth::of(words).lacks.is_some(), "{words}");
        }
        for name in ["cam/1/z", "1/depth", "clip/depth", "frame_1_z"] {
            assert_eq!(SaidOfDepth::of_name(name).lacks, None, "{name}");
        }
        for name in ["window_depth", "display", "depth", "log_cabin", "relative_to_the_camera", "norm_room", "dispatch"]
        {
            assert_eq!(SaidOfDepth::of_file(name).lacks, None, "{name}");
        }
    }

    #[test]
    fn arrays_are_called_whatever_their_unit() {
        for (name, wanted) in
            [("depth_mm", "depth"), ("DepthMap", "depth_map"), ("depthMM", "depth"), ("Z", "z"), ("depth_0", "depth")]
        {
            assert!(is_called(name, wanted), "{name}");
        }
        assert!(!is_called("depth_raw", "depth") && !is_called("mm", "depth"));
    }
}
