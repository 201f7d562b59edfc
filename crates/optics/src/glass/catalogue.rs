//! Glasses by name: the built-in catalogue, and those that are read from files.

use std::{collections::HashMap, sync::LazyLock};

use crate::{Glass, OpticsError};

/// A glass with its name.
#[derive(Clone, Debug, PartialEq)]
pub struct CatalogueGlass {
    /// Who makes it, as `SCHOTT`; `MISC` for what no one maker owns. Empty where a file does not say.
    pub maker: String,
    /// What its maker calls it, as `N-BK7`.
    pub name: String,
    /// The law of its index.
    pub glass: Glass,
}

impl CatalogueGlass {
    /// Returns the name that means this glass and no other: `SCHOTT:N-BK7`.
    pub fn full_name(&self) -> String {
        if self.maker.is_empty() { self.name.clone() } else { format!("{}:{}", self.maker, self.name) }
    }
}

/// Glasses that are found by their names.
///
/// A name is `N-BK7`, `SCHOTT:N-BK7` or `schott/n-bk7`. Where no glass has exactly that name, hyphens, blanks and
/// other signs do not count, so that `NBK7` is found too. A name that means several glasses is an error, which lists
/// them; so is one that means none, which lists similar ones. Nothing is ever replaced by something similar.
#[derive(Clone, Debug, Default)]
pub struct GlassCatalogue {
    // Invariant: `by_key` lists the index of every glass under the key of its name.
    glasses: Vec<CatalogueGlass>,
    by_key: HashMap<String, Vec<usize>>,
}

const BUILT_IN: &str = include_str!("../../data/glass/catalogue.csv");
const CRYSTALS: &str = include_str!("../../data/glass/crystals.csv");
const MAKERS: &str = include_str!("../../data/glass/makers.csv");

/// Plastics of phone lenses by the index at the d line and the Abbe number: OKP4 and OKP4HT of the maker's table of their
/// properties (Osaka Gas Chemicals), and a cyclo-olefin copolymer, whose maker's Zemax catalogue states 1.5332 and 56.15
/// (TOPAS 5013LS-01), its sheets 1.533 and 56.
const PLASTICS: [(&str, f64, f64); 3] = [("OKP4", 1.607, 27.0), ("OKP4HT", 1.632, 23.0), ("COC", 1.533, 56.0)];

/// Corning 7980, the fused silica of many catalogue lenses: Sellmeier coefficients of the maker's data sheet, `b` and
/// `c` in µm², from 185 to 1120 nm.
const CORNING_7980: ([f64; 3], [f64; 3]) =
    ([0.683740494, 0.420323613, 0.58502748], [0.00460352869, 0.0133968856, 64.4932732]);

const EYE_MEDIA: &str = include_str!("../../data/glass/eye_media.csv");

/// Names that other programs use for glasses of the built-in catalogue.
const ALIASES: &[(&str, &str)] = &[
    ("FSILICA", "FUSEDSILICA"),
    ("SILICA", "FUSEDSILICA"),
    ("ACRYLIC", "PMMA"),
    ("POLYCARB", "PC"),
    ("POLYCARBONATE", "PC"),
    ("POLYSTYR", "PS"),
    ("POLYSTYRENE", "PS"),
    ("E48R", "ZEONEXE48R"),
    ("OPTOREZ", "OPTOREZ1330"),
    ("MGF2", "MGF2O"),
    ("SAPPHIRE", "SAPPHIREO"),
    ("AL2O3", "SAPPHIREO"),
    ("GE", "GERMANIUM"),
    ("SI", "SILICON"),
    ("CALCITE", "CALCITEO"),
    ("QUARTZ", "QUARTZO"),
    // Schott's glass of this name, with lead and arsenic, had the coefficients that its successor's data sheet states.
    ("BK7", "NBK7"),
    ("HPFS7980", "C7980"),
];

impl GlassCatalogue {
    /// The built-in glasses: those of six makers and LZOS, B270, a few plastics, crystals and fluids, infrared glasses, and the
    /// media of the eye (`EYE:CORNEA`, `EYE:AQUEOUS`, `EYE:LENS`, `EYE:VITREOUS`).
    ///
    /// The numbers are the refractiveindex.info database's (public domain, CC0 1.0), but for glasses that only the catalogues of four
    /// makers have, three plastics, and the eye, whose tables are iset3d's (MIT licence). Indices are relative to air, but
    /// for the fluids, whose source gives them relative to vacuum.
    pub fn built_in() -> &'static Self {
        static CATALOGUE: LazyLock<GlassCatalogue> = LazyLock::new(|| {
            let lists = [BUILT_IN, MAKERS, CRYSTALS];
            let rows = lists.iter().flat_map(|list| list.lines()).filter(|line| !line.starts_with('#'));
            let of_database = rows.map(|row| glass_of_row(row).expect("a test reads every row"));
            let plastics = PLASTICS.map(|(name, nd, vd)| CatalogueGlass {
                maker: "MISC".to_owned(),
                name: name.to_owned(),
                glass: Glass::NdVd { nd, vd },
            });
            GlassCatalogue::new(of_database.chain(plastics).chain([corning_7980()]).chain(eye_media()).collect())
        });
        &CATALOGUE
    }

    /// Returns a catalogue of these glasses.
    pub fn new(glasses: Vec<CatalogueGlass>) -> Self {
        let mut by_key: HashMap<String, Vec<usize>> = HashMap::with_capacity(glasses.len());
        for (i, glass) in glasses.iter().enumerate() {
            by_key.entry(key_of(&glass.name)).or_default().push(i);
        }
        Self { glasses, by_key }
    }

    /// All glasses, in the order of the source.
    pub fn glasses(&self) -> &[CatalogueGlass] {
        &self.glasses
    }

    /// Returns the names of the makers, each once, in alphabetical order.
    pub fn makers(&self) -> Vec<&str> {
        let mut makers: Vec<&str> = self.glasses.iter().map(|glass| glass.maker.as_str()).collect();
        makers.sort_unstable();
        makers.dedup();
        makers
    }

    /// Returns the glass of this name, with or without its maker.
    ///
    /// # Errors
    /// When the name means no glass, or several.
    pub fn find(&self, name: &str) -> Result<&CatalogueGlass, OpticsError> {
        match self.all_named(name).as_slice() {
            [] => Err(self.unknown(name)),
            [glass] => Ok(glass),
            several => {
                let candidates = several.iter().map(|glass| glass.full_name()).collect();
                Err(OpticsError::Ambiguous { kind: "glass", name: name.to_owned(), candidates })
            }
        }
    }

    /// Returns the glass of this name from the first of these makers that has one, else as [`find`](Self::find) does.
    ///
    /// # Errors
    /// When the name means no glass, or several and none of these makers'.
    pub fn find_among(&self, name: &str, makers: &[String]) -> Result<&CatalogueGlass, OpticsError> {
        let named = self.all_named(name);
        let of_maker = |maker: &String| {
            let mut found = named.iter().filter(|glass| glass.maker.eq_ignore_ascii_case(maker));
            found.next().filter(|_| found.next().is_none())
        };
        makers.iter().find_map(of_maker).map_or_else(|| self.find(name), |glass| Ok(glass))
    }

    /// Returns the glasses nearest to an index at the d line and an Abbe number, the nearest first, each with its
    /// distance.
    ///
    /// Distances are counted in the usual tolerances of a melt, 0.0005 in `n_d` and 0.8 % in `V_d`, added in quadrature.
    pub fn nearest(&self, nd: f64, vd: f64, n_glasses: usize) -> Vec<(&CatalogueGlass, f64)> {
        let distance = |glass: &CatalogueGlass| {
            let (its_nd, its_vd) = glass.glass.nd_vd()?;
            let distance = ((its_nd - nd) / 0.0005).hypot((its_vd - vd) / (0.008 * vd));
            distance.is_finite().then_some(distance)
        };
        let mut found: Vec<_> = self.glasses.iter().filter_map(|glass| Some((glass, distance(glass)?))).collect();
        found.sort_by(|a, b| a.1.total_cmp(&b.1));
        found.truncate(n_glasses);
        found
    }

    /// Returns the glasses whose full name holds this text, whatever the case.
    pub fn search(&self, text: &str) -> impl Iterator<Item = &CatalogueGlass> {
        let text = text.to_uppercase();
        self.glasses.iter().filter(move |glass| glass.full_name().to_uppercase().contains(&text))
    }

    /// Every glass that the name could mean.
    fn all_named(&self, name: &str) -> Vec<&CatalogueGlass> {
        let (maker, name) = split_maker(name);
        let key = key_of(name);
        let key = match ALIASES.iter().find(|(alias, _)| *alias == key) {
            Some((alias, other)) if !self.by_key.contains_key(*alias) => (*other).to_owned(),
            _ => key,
        };
        let all = self.by_key.get(&key).into_iter().flatten().map(|&i| &self.glasses[i]);
        let all: Vec<_> = all.filter(|glass| maker.is_none_or(|m| glass.maker.eq_ignore_ascii_case(m))).collect();
        let exact: Vec<_> = all.iter().copied().filter(|glass| glass.name.eq_ignore_ascii_case(name)).collect();
        if exact.is_empty() { all } else { exact }
    }

    fn unknown(&self, name: &str) -> OpticsError {
        let (_, bare) = split_maker(name);
        let key = key_of(bare);
        let mut similar: Vec<&CatalogueGlass> = match key.len() {
            0 | 1 => Vec::new(),
            _ => self.glasses.iter().filter(|glass| key_of(&glass.name).contains(&key)).collect(),
        };
        similar.sort_by_key(|glass| glass.name.len());
        let known = match similar.as_slice() {
            [] => "no name is similar".to_owned(),
            some => {
                let names: Vec<String> = some.iter().take(8).map(|glass| glass.full_name()).collect();
                format!("similar names are {}", names.join(", "))
            }
        };
        OpticsError::Unknown { kind: "glass", name: name.to_owned(), known }
    }
}

/// Splits `MAKER:NAME` or `maker/name`.
fn split_maker(name: &str) -> (Option<&str>, &str) {
    match name.split_once([':', '/']) {
        Some((maker, name)) => (Some(maker.trim()), name.trim()),
        None => (None, name.trim()),
    }
}

/// What counts of a name when signs do not: its letters, in capitals, and its digits.
fn key_of(name: &str) -> String {
    name.chars().filter(char::is_ascii_alphanumeric).map(|c| c.to_ascii_uppercase()).collect()
}

/// Reads a row `maker,name,formula,first_nm,last_nm,numbers` of the built-in catalogue.
fn glass_of_row(row: &str) -> Option<CatalogueGlass> {
    let cells: Vec<&str> = row.split(',').collect();
    let [maker, name, formula, first_nm, last_nm, numbers] = cells[..] else { return None };
    let numbers: Vec<f64> = numbers.split(' ').map(str::parse).collect::<Result<_, _>>().ok()?;
    let glass = if formula == "t" {
        let column = |first: usize| numbers.iter().skip(first).step_by(2).copied().collect();
        Glass::Tabulated { wavelengths_nm: column(0), indices: column(1) }
    } else {
        let range_nm = Some((first_nm.parse().ok()?, last_nm.parse().ok()?));
        Glass::Formula { formula: formula.parse().ok()?, coefficients: numbers, range_nm }
    };
    Some(CatalogueGlass { maker: maker.to_owned(), name: name.to_owned(), glass })
}

fn corning_7980() -> CatalogueGlass {
    let (b, c_um2) = (CORNING_7980.0.to_vec(), CORNING_7980.1.to_vec());
    let glass = Glass::Sellmeier { b, c_um2, range_nm: Some((185.0, 1120.0)) };
    CatalogueGlass { maker: "CORNING".to_owned(), name: "C79-80".to_owned(), glass }
}

/// Returns the media of the eye.
fn eye_media() -> Vec<CatalogueGlass> {
    let mut rows = EYE_MEDIA.lines().filter(|line| !line.starts_with('#')).map(|line| line.split(','));
    let names: Vec<&str> = rows.next().into_iter().flatten().skip(1).collect();
    let numbers = |row: std::str::Split<char>| row.map(|cell| cell.parse().expect("a test reads every row")).collect();
    let rows: Vec<Vec<f64>> = rows.map(numbers).collect();
    let column = |i: usize| rows.iter().map(|row| row[i]).collect::<Vec<f64>>();
    let medium = |(i, name): (usize, &&str)| CatalogueGlass {
        maker: "EYE".to_owned(),
        name: name.to_uppercase(),
        glass: Glass::Tabulated { wavelengths_nm: column(0), indices: column(i + 1) },
    };
    names.iter().enumerate().map(medium).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn glasses_of_makers_have_the_indices_of_their_lists() {
        // At the lines h, g, F, d, C: Hikari's catalogue of 2020 and Ohara's.
        let nm = [404.656, 435.835, 486.133, 587.562, 656.273];
        for (name, listed) in [
            ("J-KZFH9", [1.77949, 1.767673, 1.754185, 1.738, 1.731309]),
            ("J-SFH4", [1.710834, 1.696531, 1.681192, 1.66382, 1.656918]),
            ("S-LAH99", [2.06424, 2.046, 2.0254, 2.001, 1.99105]),
        ] {
            let found = &GlassCatalogue::built_in().find(name).unwrap().glass;
            for (nm, listed) in nm.into_iter().zip(listed) {
                assert!((found.index_at(nm).unwrap() - listed).abs() < 6e-6, "{name} {nm}");
            }
        }
    }

    #[test]
    fn every_row_is_read_and_makes_sense() {
        let catalogue = GlassCatalogue::built_in();
        assert_eq!(catalogue.glasses().len(), 1694 + 43 + 31 + PLASTICS.len() + 1 + 4);
        let mut n_infrared = 0;
        for glass in catalogue.glasses() {
            glass.glass.check().unwrap();
            assert_eq!(catalogue.find(&glass.full_name()).unwrap(), glass);
            let (first_nm, last_nm) = glass.glass.range_nm().unwrap_or((400.0, 700.0));
            match glass.glass.nd_vd() {
                Some((nd, vd)) => {
                    assert!((1.0..2.7).contains(&nd) && (8.0..120.0).contains(&vd), "{} {nd} {vd}", glass.full_name());
                }
                None => {
                    assert!(last_nm > 10_000.0, "{}", glass.full_name());
                    n_infrared += 1;
                }
            }
            for nm in [first_nm, 0.5 * (first_nm + last_nm), last_nm] {
                let index = glass.glass.index_at(nm).unwrap();
                assert!((1.0..4.2).contains(&index), "{} {nm} {index}", glass.full_name());
            }
        }
        assert_eq!(n_infrared, 15);
        let makers =
            ["AMI", "CDGM", "CORNING", "EYE", "HIKARI", "HOYA", "LZOS", "MISC", "OHARA", "SCHOTT", "SUMITA", "VITRON"];
        assert_eq!(catalogue.makers(), makers);
    }

    /// Numbers of other papers and handbooks than those whose formulas are embedded; the samples differ by about as much.
    #[test]
    fn infrared_materials_have_the_indices_of_other_measurements() {
        let check = |name: &str, um: f64, expected: f64, tolerance: f64| {
            let found = GlassCatalogue::built_in().find(name).unwrap().glass.index_at(1e3 * um).unwrap();
            assert!((found - expected).abs() <= tolerance, "{name} at {um} um: {found}, expected {expected}");
        };
        // H. H. Li's critical tables of germanium and silicon (1980).
        check("germanium", 4.0, 4.0242, 2e-3);
        check("Ge", 10.0, 4.0025, 2e-3);
        check("SILICON", 2.0, 3.4510, 3e-3);
        check("Si", 10.0, 3.4150, 3e-3);
        // Sellmeier coefficients of the Handbook of Optics: b, then c in square micrometres.
        let handbook = |b: [f64; 3], c: [f64; 3], um: f64| {
            let w2 = um * um;
            b.iter().zip(c).fold(1.0, |n2, (b, c)| n2 + b * w2 / (w2 - c)).sqrt()
        };
        let silver = |um| handbook([2.062508, 0.9461465, 4.300785], [1.07963322e-2, 5.94721379e-2, 5020.74704], um);
        let caesium = |um| handbook([0.9533786, 0.8303809, 2.847172], [8.20189243e-3, 2.79396908e-2, 14164.6892], um);
        for um in [1.0, 4.0, 10.0] {
            check("AgCl", um, silver(um), 2e-4);
            check("CsBr", um, caesium(um), 6e-4);
        }
    }

    #[test]
    fn cornea_of_the_eye_has_its_keratometric_neighborhood() {
        let cornea = GlassCatalogue::built_in().find("eye:cornea").unwrap();
        // The index of the schematic eyes, 1.376, at the wavelength that they are stated for.
        assert!((cornea.glass.index_at(589.3).unwrap() - 1.376).abs() < 2e-4);
        assert_eq!(cornea.glass.range_nm(), Some((365.0, 1010.0)));
    }

    #[track_caller]
    fn check(name: &str, expected: &str) {
        assert_eq!(GlassCatalogue::built_in().find(name).unwrap().full_name(), expected);
    }

    #[test]
    fn name_is_found_with_or_without_its_maker_in_any_case() {
        check("N-BK7", "SCHOTT:N-BK7");
        check("n-bk7", "SCHOTT:N-BK7");
        check("SCHOTT:N-BK7", "SCHOTT:N-BK7");
        check("schott/n-bk7", "SCHOTT:N-BK7");
        check("NBK7", "SCHOTT:N-BK7");
        check("cdgm:f2", "CDGM:F2");
        check("acrylic", "MISC:PMMA");
        check("BK7", "SCHOTT:N-BK7");
        check("HPFS 7980", "CORNING:C79-80");
    }

    #[test]
    fn corning_7980_has_the_indices_of_its_data_sheet() {
        let glass = GlassCatalogue::built_in().find("C79-80").unwrap();
        let (nd, vd) = glass.glass.nd_vd().unwrap();
        // The sheet rounds to 1.45847 and 67.8; Malitson's fused silica is 1.45846.
        assert!((nd - 1.458467).abs() < 1e-6 && (vd - 67.795).abs() < 2e-3, "{nd} {vd}");
    }

    #[track_caller]
    fn message(name: &str) -> String {
        GlassCatalogue::built_in().find(name).unwrap_err().to_string()
    }

    #[test]
    fn name_of_several_or_none_is_reported() {
        let expected = "glass 'F2' could be CDGM:F2, HIKARI:F2 or SCHOTT:F2; name one of them";
        assert_eq!(message("F2"), expected);
        let similar = "no glass is named 'SK5'; similar names are HIKARI:E-SK5, HIKARI:J-SK5, SCHOTT:N-SK5";
        assert!(message("SK5").starts_with(similar), "{}", message("SK5"));
        assert_eq!(message("Unobtainium"), "no glass is named 'Unobtainium'; no name is similar");
        assert!(message("OHARA:N-BK7").contains("similar names are SCHOTT:N-BK7"));
        assert!(message("").contains("no glass is named ''"));
    }

    #[test]
    fn makers_that_a_file_names_decide() {
        let find = |makers: &[&str]| {
            let makers: Vec<String> = makers.iter().map(|&maker| maker.to_owned()).collect();
            GlassCatalogue::built_in().find_among("F2", &makers).map(CatalogueGlass::full_name)
        };
        assert_eq!(find(&["HOYA", "hikari", "SCHOTT"]).unwrap(), "HIKARI:F2");
        assert!(find(&["OHARA"]).is_err());
    }

    #[test]
    fn nearest_is_the_glass_itself_then_its_kin() {
        let nearest = GlassCatalogue::built_in().nearest(1.5168, 64.17, 12);
        assert_eq!(nearest.len(), 12);
        let names: Vec<String> = nearest.iter().map(|(glass, _)| glass.full_name()).collect();
        assert!(names.contains(&"SCHOTT:N-BK7".to_owned()), "{names:?}");
        assert!(nearest[0].1 < 0.05 && nearest.windows(2).all(|two| two[0].1 <= two[1].1));
        assert!(GlassCatalogue::built_in().search("lak").count() > 50);
    }
}
