//! What GDAL writes of the bands of a TIFF file: tag 42112, XML of an item a statement ("`GTiff` driver" of GDAL's manual, "Metadata").

use ndarray::Array2;

use super::{
    picture_parts::comment,
    wavelength_unit::{in_nm, wavelength_in},
};

/// The tag.
pub(super) const GDAL: u16 = 42_112;

/// A statement.
struct Item {
    name: String,
    /// What it is to GDAL itself, as `scale`.
    role: String,
    /// The sample of a pixel, from 0, where it is of one.
    sample: Option<usize>,
    text: String,
}

/// What is stated of the samples of a pixel.
#[derive(Clone, Debug, Default)]
pub(super) struct GdalWords {
    /// What makes the quantity of each sample's numbers: a factor and what is added then; none where all are 1 and 0.
    packing: Vec<[f64; 2]>,
    /// The unit of all.
    pub(super) unit: Option<String>,
    pub(super) wavelengths_nm: Option<Vec<f64>>,
    /// Names of what is not used.
    pub(super) left: Vec<String>,
}

impl GdalWords {
    pub(super) fn of(xml: &str, n_samples: usize) -> Self {
        let mut items: Vec<Item> = xml.split("<Item").skip(1).filter_map(item_of).collect();
        // A list with the text of each sample; none where one lacks it.
        let mut take = |is_wanted: &dyn Fn(&Item) -> bool| -> Option<Vec<String>> {
            let of = |sample: usize| items.iter().position(|own| own.sample == Some(sample) && is_wanted(own));
            let places: Vec<usize> = (0..n_samples).map(of).collect::<Option<_>>()?;
            let texts = places.iter().map(|place| items[*place].text.clone()).collect();
            let mut index = 0;
            items.retain(|_| {
                index += 1;
                !places.contains(&(index - 1))
            });
            Some(texts)
        };
        let numbers = |texts: &[String]| texts.iter().map(|text| text.parse().ok()).collect::<Option<Vec<f64>>>();
        let named = |name: &'static str| move |own: &Item| own.name.eq_ignore_ascii_case(name);
        let of_micrometres = take(&named("CENTRAL_WAVELENGTH_UM")).and_then(|texts| in_nm("um", &numbers(&texts)?));
        let of_unit = || {
            let (texts, units) = (take(&named("wavelength"))?, take(&named("wavelength_units"))?);
            in_nm(units.first()?, &numbers(&texts)?).filter(|_| units.iter().all(|own| *own == units[0]))
        };
        let wavelengths_nm = of_micrometres.or_else(of_unit);
        let wavelengths_nm = wavelengths_nm.or_else(|| {
            let texts = take(&|own: &Item| own.role == "description" && wavelength_in(&own.text).is_some())?;
            texts.iter().map(|text| wavelength_in(text)).collect()
        });
        let units = take(&|own: &Item| own.role == "unittype").unwrap_or_default();
        let unit = units.first().filter(|first| units.iter().all(|own| own == *first)).cloned();
        let mut packing = vec![[1.0, 0.0]; n_samples];
        items.retain(|own| {
            let place = ["scale", "offset"].iter().position(|role| *role == own.role);
            let number = own.text.parse::<f64>().ok().filter(|v| v.is_finite() && (*v != 0.0 || own.role == "offset"));
            let (Some(place), Some(number)) = (place, number) else { return true };
            let Some(packing) = own.sample.and_then(|sample| packing.get_mut(sample)) else { return true };
            packing[place] = number;
            false
        });
        if packing.iter().all(|own| *own == [1.0, 0.0]) {
            packing.clear();
        }
        items.retain(|own| match own.role.as_str() {
            "colorinterp" => ["alpha", "palette"].contains(&own.text.to_lowercase().as_str()),
            "description" => comment(own.text.as_bytes()).is_some(),
            _ => {
                const HARMLESS: [&str; 4] = ["STATISTICS_", "AREA_OR_POINT", "TIFFTAG_", "FWHM_UM"];
                !HARMLESS.iter().any(|start| own.name.starts_with(start))
            }
        });
        let mut left: Vec<String> = items.into_iter().map(|own| format!("{}={}", own.name, own.text)).collect();
        if unit.is_none() {
            left.extend(units.into_iter().map(|own| format!("UNITTYPE={own}")));
        }
        Self { packing, unit: unit.filter(|own| !own.is_empty()), wavelengths_nm, left }
    }

    /// Whether its numbers are no quantity before they are unpacked.
    pub(super) fn is_packed(&self) -> bool {
        !self.packing.is_empty()
    }

    /// The factor of its first sample, where its numbers are packed.
    pub(super) fn factor(&self) -> Option<f64> {
        self.packing.first().map(|own| own[0])
    }

    /// Makes the quantities of the planes' numbers, sample by sample.
    pub(super) fn unpack(&self, planes: &mut [Array2<f32>]) {
        if self.is_packed() {
            for (plane, [scale, offset]) in planes.iter_mut().zip(self.packing.iter().cycle()) {
                plane.mapv_inplace(|v| (f64::from(v) * scale + offset) as f32);
            }
        }
    }

    /// Returns the names of what no picture is made of.
    pub(super) fn of_numbers(&self) -> Vec<String> {
        let packing = self.packing.first().map(|[scale, offset]| format!("scale {scale}, offset {offset}"));
        packing.into_iter().chain(self.unit.as_ref().map(|own| format!("unit {own}"))).collect()
    }
}

/// Reads what follows `<Item`.
fn item_of(text: &str) -> Option<Item> {
    let (head, rest) = text.split_once('>')?;
    let body = rest.split("</Item").next().unwrap_or_default();
    let attribute = |name: &str| {
        let rest = head.split_once(&format!(" {name}=\""))?.1;
        Some(rest.split('"').next().unwrap_or_default().to_owned())
    };
    let plain = |text: &str| {
        let text = text.replace("&lt;", "<").replace("&gt;", ">").replace("&quot;", "\"").replace("&#181;", "µ");
        text.replace("&amp;", "&").trim().to_owned()
    };
    Some(Item {
        name: attribute("name")?,
        role: attribute("role").unwrap_or_default().to_lowercase(),
        sample: attribute("sample").and_then(|own| own.parse().ok()),
        text: plain(body),
    })
}

#[cfg(test)]
mod tests {
    use std::{fs::File, path::Path};

    use approx::assert_relative_eq;
    use tiff::{
        encoder::{Rational, TiffEncoder, colortype},
        tags::Tag,
    };

    use super::{super::read_scene, *};
    use crate::{ReadOptions, Scene};

    fn xml(items: &[(&str, usize, &str, &str)]) -> String {
        let item = |(name, sample, more, text): &(&str, usize, &str, &str)| {
            format!("<Item name=\"{name}\" sample=\"{sample}\" {more}>{text}</Item>\n")
        };
        format!("<GDALMetadata>\n{}</GDALMetadata>", items.iter().map(item).collect::<String>())
    }

    /// A page of 2 × 1 samples of red, green and blue, the second that for none.
    fn write(path: &Path, gdal: &str) {
        let mut encoder = TiffEncoder::new(File::create(path).unwrap()).unwrap();
        let mut page = encoder.new_image::<colortype::RGB16>(2, 1).unwrap();
        page.encoder().write_tag(Tag::Unknown(GDAL), gdal).unwrap();
        page.encoder().write_tag(Tag::GdalNodata, "9").unwrap();
        page.write_data(&[100, 200, 300, 9, 50, 60]).unwrap();
    }

    fn read(path: &Path) -> Scene {
        read_scene(path, &ReadOptions::default()).unwrap()
    }

    #[test]
    fn bands_are_what_gdal_states() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.tif");
        let bands = ["0.45", "0.55", "0.65"];
        let mut items = vec![("BAND_GAIN", 0, "", "7")];
        for (sample, um) in bands.into_iter().enumerate() {
            items.push(("CENTRAL_WAVELENGTH_UM", sample, "domain=\"IMAGERY\"", um));
            items.push(("SCALE", sample, "role=\"scale\"", "0.5"));
            items.push(("OFFSET", sample, "role=\"offset\"", "1"));
            items.push(("UNITTYPE", sample, "role=\"unittype\"", "W/m2/sr/um"));
            items.push(("STATISTICS_MEAN", sample, "", "3"));
        }
        write(&path, &xml(&items));
        let scene = read(&path);
        assert_eq!(scene.radiance.grid().centers_nm(), [450.0, 550.0, 650.0]);
        for (found, code) in scene.radiance.spectrum_at(0, 0).into_iter().zip([100.0, 200.0, 300.0]) {
            assert_relative_eq!(found, (0.5 * code + 1.0) * 1e-3, max_relative = 1e-6);
        }
        let notes = scene.notes.join("\n");
        assert!(
            notes.contains("'BAND_GAIN=7'") && !notes.contains("42112") && !notes.contains("STATISTICS"),
            "{notes}"
        );
        // Of a picture it is named.
        write(&path, &xml(&items[2..4]));
        assert!(read(&path).notes.join("\n").contains("'scale 0.5, offset 1'"));
    }

    /// A page a band: each with its own scale, wavelength and words.
    #[test]
    fn every_page_is_heard() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.tif");
        let mut encoder = TiffEncoder::new(File::create(&path).unwrap()).unwrap();
        for (um, scale, code) in [("0.45", "0.5", 100), ("0.55", "0.25", 400)] {
            let mut page = encoder.new_image::<colortype::Gray16>(1, 1).unwrap();
            let items = [
                ("CENTRAL_WAVELENGTH_UM", 0, "", um),
                ("SCALE", 0, "role=\"scale\"", scale),
                ("UNITTYPE", 0, "role=\"unittype\"", "W/m2/sr/nm"),
                ("BAND_GAIN", 0, "", um),
            ];
            page.encoder().write_tag(Tag::Unknown(GDAL), xml(&items).as_str()).unwrap();
            page.encoder().write_tag(Tag::Software, "radiance in percent").unwrap();
            page.encoder().write_tag(Tag::Artist, "A. Nobody").unwrap();
            page.write_data(&[code]).unwrap();
        }
        let scene = read(&path);
        assert_eq!(scene.radiance.grid().centers_nm(), [450.0, 550.0]);
        assert_eq!(scene.radiance.spectrum_at(0, 0), [50.0, 100.0]);
        let notes = scene.notes.join("\n");
        for word in ["'BAND_GAIN=0.45', 'BAND_GAIN=0.55'", "'Software: radiance in percent'"] {
            assert!(notes.contains(word) && !notes.contains("42112") && !notes.contains("Nobody"), "{word}: {notes}");
        }
    }

    #[test]
    fn cameras_and_editors_are_heard_in_tiff() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.tif");
        let mut encoder = TiffEncoder::new(File::create(&path).unwrap()).unwrap();
        let mut page = encoder.new_image::<colortype::RGB8>(1, 1).unwrap();
        page.encoder().write_tag(Tag::Unknown(0x920A), Rational { n: 35, d: 1 }).unwrap();
        page.encoder().write_tag(Tag::Unknown(269), "reflectance in percent").unwrap();
        let xmp = b"<x xmlns:Camera='a' Camera:BandName='red'/>";
        page.encoder().write_tag(Tag::Unknown(700), &xmp[..]).unwrap();
        page.write_data(&[1, 2, 3]).unwrap();
        let notes = read(&path).notes.join("\n");
        for word in ["a focal length of 35 mm", "reflectance in percent", "Camera:BandName (XMP)"] {
            assert!(notes.contains(word) && !notes.contains("'700'"), "{word}: {notes}");
        }
        // Of cubes too.
        drop(encoder);
        let mut encoder = TiffEncoder::new(File::create(&path).unwrap()).unwrap();
        for _ in 0..2 {
            let mut page = encoder.new_image::<colortype::Gray32Float>(3, 2).unwrap();
            let xmp = b"<x xmlns:exif='a' exif:FocalLengthIn35mmFilm='50'/>";
            page.encoder().write_tag(Tag::Unknown(700), &xmp[..]).unwrap();
            page.write_data(&[0.5; 6]).unwrap();
        }
        let reading = crate::FileReading {
            quantity: Some(crate::FileQuantity::Radiance),
            wavelengths_nm: Some(vec![450.0, 550.0]),
            ..crate::FileReading::default()
        };
        let notes = read_scene(&path, &ReadOptions { reading, ..ReadOptions::default() }).unwrap().notes.join("\n");
        assert!(notes.contains("a focal length of 50 mm on 35 mm film"), "{notes}");
    }
}
