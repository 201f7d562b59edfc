//! Maps of depth in TIFF files as DNG has them (Digital Negative Specification 1.5, "Depth Maps").

use std::io::{Read, Seek};

use ndarray::Array2;
use tiff::{
    decoder::{Decoder, ifd::Value},
    tags::Tag,
};

use super::reading::DepthKind;

/// The tags of depths: their format, the nearest, the farthest, their unit, and what they are measured along.
pub(super) const DEPTH_TAGS: [u16; 5] = [51_177, 51_178, 51_179, 51_180, 51_181];

/// What a page says of its depths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct DepthMapTags {
    /// 1: numbers go with the depth, 2: with its inverse; 0: nothing is stated.
    format: u32,
    /// The depths of 0 and of the largest number, which may be infinite.
    ends: Option<[f64; 2]>,
    /// 1: metres.
    unit: u32,
    /// 1: along the axis, 2: along the ray.
    measure: u32,
}

/// The numbers of a map of depth, and what they are.
pub(super) struct MappedDepths {
    pub(super) values: Array2<f32>,
    pub(super) kind: DepthKind,
    /// The largest number of whole ones, where they stay as they stand.
    pub(super) top: Option<f64>,
    /// The length of 1, m.
    pub(super) unit_m: Option<f64>,
    /// What is asked for, where the file does not say it.
    pub(super) lacks: Option<&'static str>,
}

impl DepthMapTags {
    pub(super) fn of<R: Read + Seek>(decoder: &mut Decoder<R>) -> Self {
        let mut number = |tag: u16| decoder.find_tag_unsigned::<u32>(Tag::Unknown(tag)).ok().flatten().unwrap_or(0);
        let [format, unit, measure] = [number(DEPTH_TAGS[0]), number(DEPTH_TAGS[3]), number(DEPTH_TAGS[4])];
        let mut end = |tag: u16| match decoder.find_tag(Tag::Unknown(tag)) {
            Ok(Some(Value::Rational(over, under))) => {
                Some(f64::from(over) / f64::from(under)).filter(|end| !end.is_nan())
            }
            _ => None,
        };
        let ends = end(DEPTH_TAGS[1]).zip(end(DEPTH_TAGS[2])).map(|(near, far)| [near, far]);
        Self { format, ends, unit, measure }
    }

    /// Returns the depths of numbers whose largest is `top`, 1 of floats.
    pub(super) fn depths(self, mut values: Array2<f32>, top: Option<f64>) -> MappedDepths {
        let full = top.unwrap_or(1.0);
        let is_inverse = self.format == 2;
        let ends = self.ends.map(|ends| if is_inverse { ends.map(f64::recip) } else { ends });
        let ends = ends.filter(|ends| self.format != 0 && ends.iter().all(|end| end.is_finite()));
        if let Some([first, last]) = ends {
            values.mapv_inplace(|v| (first + (last - first) * f64::from(v) / full) as f32);
        } else if is_inverse {
            // The nearest is 0.
            values.mapv_inplace(|v| (full - f64::from(v)) as f32);
        }
        let is_known = ends.is_some() && self.unit == 1;
        if is_known && is_inverse {
            values.mapv_inplace(f32::recip);
        }
        // Without a word of what they are its numbers are those of any depth.
        let says_nothing = self.format == 0 && self.ends.is_none() && self.unit == 0;
        let lacks = match (is_known || says_nothing, is_inverse, ends) {
            (true, ..) => None,
            (_, false, None) => Some(
                "its DepthFormat, DepthNear and DepthFar do not say what its numbers are: expected --depth-unit, as mm, or \
                 --depth-kind",
            ),
            (_, true, _) => {
                Some("its numbers are inverse depths of no stated unit: expected --depth-kind, as inverse:NEAR_M,FAR_M")
            }
            (_, false, Some(_)) => Some("its depths have no stated unit: expected --depth-unit, as mm"),
        };
        MappedDepths {
            values,
            kind: match self.measure {
                _ if is_inverse && !is_known => DepthKind::Inverse,
                2 => DepthKind::Radial,
                _ => DepthKind::Axial,
            },
            top: top.filter(|_| ends.is_none() && !is_inverse),
            unit_m: is_known.then_some(1.0),
            lacks,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::{fs, path::Path};

    use tiff::{
        encoder::{Rational, TiffEncoder, colortype::Gray16},
        tags::Tag,
    };

    use super::{
        super::{FileReading, ReadOptions, read_scene},
        DEPTH_TAGS,
    };
    use crate::{Scene, SceneError};

    const CODES: [u16; 2] = [0, 65_535];
    const METRES: u16 = 1;

    /// Writes a picture and a map of depth as its second page, or the map alone.
    fn write(path: &Path, has_picture: bool, mark: (u16, u32), tags: Option<[u16; 3]>, ends: [(u32, u32); 2]) {
        let mut encoder = TiffEncoder::new(fs::File::create(path).unwrap()).unwrap();
        if has_picture {
            encoder.write_image::<Gray16>(2, 1, &[9000, 9000]).unwrap();
        }
        let mut image = encoder.new_image::<Gray16>(2, 1).unwrap();
        let page = image.encoder();
        page.write_tag(Tag::PhotometricInterpretation, mark.0).unwrap();
        page.write_tag(Tag::NewSubfileType, mark.1).unwrap();
        if let Some([format, unit, measure]) = tags {
            for (tag, value) in [(0, format), (3, unit), (4, measure)] {
                page.write_tag(Tag::Unknown(DEPTH_TAGS[tag]), value).unwrap();
            }
            for (tag, (n, d)) in [1, 2].into_iter().zip(ends) {
                page.write_tag(Tag::Unknown(DEPTH_TAGS[tag]), Rational { n, d }).unwrap();
            }
        }
        image.write_data(&CODES).unwrap();
    }

    fn read(path: &Path, reading: FileReading) -> Result<Scene, SceneError> {
        read_scene(path, &ReadOptions { horizontal_fov_deg: Some(1.0), reading, ..ReadOptions::default() })
    }

    #[test]
    fn depth_maps_of_tiff_files_are_those_of_their_picture() {
        let folder = tempfile::tempdir().unwrap();
        let [own, picture, map] = ["a.tif", "p.png", "d.tif"].map(|name| folder.path().join(name));
        dioptric_pictures::save(&image::GrayImage::from_pixel(2, 1, image::Luma([99])).into(), &picture).unwrap();
        let inf = f32::INFINITY;
        for (mark, tags, ends, expected) in [
            ((51_177, 8), Some([1, METRES, 1]), [(1, 2), (5, 1)], [0.5, 5.0]),
            ((51_177, 8), Some([2, METRES, 0]), [(1, 2), (1, 0)], [0.5, inf]),
            ((51_177, 0), Some([2, METRES, 2]), [(1, 2), (4, 1)], [0.5, 4.0]),
            // Without a word of what they are the codes are those of any depth, of which the last stands for none.
            ((1, 8), None, [(0, 0); 2], [0.0, 0.0]),
        ] {
            write(&own, true, mark, tags, ends);
            write(&map, false, mark, tags, ends);
            let told = FileReading { depth: Some(map.clone()), ..FileReading::default() };
            for read in [read(&own, FileReading::default()), read(&picture, told)] {
                if tags.is_none() {
                    assert!(read.unwrap_err().to_string().contains("no sample of it has a depth"));
                    continue;
                }
                let scene = read.unwrap();
                let depths = scene.require_depth().unwrap().z_m().clone();
                // A ray half a sample beside the axis is longer by 1e-5.
                let is_near = |(own, expected): (&f32, f32)| *own == expected || (own / expected - 1.0).abs() < 1e-4;
                assert!(depths.iter().zip(expected).all(is_near), "{mark:?}, {tags:?}: {depths}");
                assert_eq!(scene.notes.len(), 1, "{:?}", scene.notes);
            }
        }
        // Below the page of the picture, in a directory that is no page: that of the second page, which the first calls its own.
        write(&own, true, (51_177, 8), Some([1, METRES, 1]), [(1, 2), (5, 1)]);
        let mut bytes = fs::read(&own).unwrap();
        let four = |bytes: &[u8], at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
        let first = four(&bytes, 4);
        let end = first + 2 + 12 * usize::from(u16::from_le_bytes([bytes[first], bytes[first + 1]]));
        let map_at = four(&bytes, end) as u32;
        // Its last entry gives way to the link, and no page follows.
        bytes[end - 12..end].copy_from_slice(&[&[0x4a, 1, 4, 0, 1, 0, 0, 0][..], &map_at.to_le_bytes()].concat());
        bytes[end..end + 4].fill(0);
        fs::write(&own, bytes).unwrap();
        let scene = read(&own, FileReading::default()).unwrap();
        assert_eq!(scene.require_depth().unwrap().range_m(), (0.5, 5.0), "{:?}", scene.notes);
        write(&own, true, (51_177, 8), Some([2, 0, 0]), [(1, 2), (4, 1)]);
        let message = read(&own, FileReading::default()).unwrap_err().to_string();
        assert!(message.contains("inverse depths") && message.contains("--depth-kind"), "{message}");
        for (format, ends) in [(1, [(0, 0), (5, 1)]), (1, [(1, 2), (1, 0)]), (0, [(1, 2), (5, 1)])] {
            write(&own, true, (51_177, 8), Some([format, METRES, 1]), ends);
            let message = read(&own, FileReading::default()).unwrap_err().to_string();
            assert!(message.contains("do not say what its numbers are"), "{message}");
        }
        let message = read(&map, FileReading::default()).unwrap_err().to_string();
        assert!(message.contains("no picture: expected it as --depth"), "{message}");
    }
}
