//! Files that are made: pictures whose checksums are right and whose content is not, and what command lines name.

use std::fs;

use crate::{Files, common};

/// The beginning of a world: a camera and a light.
pub(crate) const WORLD: &str = "LookAt 0 0 -5 0 0 0 0 1 0\nCamera \"perspective\" \"float fov\" 40\nWorldBegin\n\
    LightSource \"infinite\" \"spectrum L\" \"stdillum-D65\"\n";

/// Returns the files beside which command lines are run.
pub(crate) fn around() -> Files<'static> {
    let rays = "x_mm,y_mm,z_mm,l,m,n,wavelength_nm\n";
    let texts = [
        ("camera.ron", common::CAMERA.to_owned()),
        ("note.txt", "only words\n".to_owned()),
        ("rays1.csv", "x,y\n1,2\n".to_owned()),
        ("rays2.csv", format!("{rays}0,0,-10,0,0,1\n")),
        ("rays3.csv", format!("{rays}0,0,-10,0,0,x,550\n")),
        ("rays4.csv", format!("{rays}0,0,-10,0,0,0,550\n")),
        ("ok.csv", format!("{rays}0,0,-10,0,0,1,550\n")),
        ("bad.obj", "v 0 0 0\nf 1 2 3\n".to_owned()),
        ("bad.ply", "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nend_header\n0\n".to_owned()),
        ("bad.gltf", "{\"asset\":{\"version\":\"1.0\"}}".to_owned()),
        ("bad.glb", "glTF\u{2}\0\0\0\u{7f}\u{7f}\u{7f}\u{7f}".to_owned()),
        ("deep.gltf", "[".repeat(100_000)),
        (
            "huge.ply",
            "ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty float x\nproperty float y\n\
             property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\nxx"
                .to_owned(),
        ),
        ("w.pbrt", format!("{WORLD}Shape \"sphere\"\n")),
        ("plan.ron", "(base: File(\"camera.ron\"), vary: [Grid({\"seed\": List([1, 2])})])".to_owned()),
    ];
    let made = [("good.exr", irradiance()), ("flat.png", png(&Png { width: 64, height: 64, ..Png::default() }))];
    texts.into_iter().map(|(name, text)| (name, text.into_bytes())).chain(made).collect()
}

/// Returns the irradiance of the small camera.
fn irradiance() -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("camera.ron"), common::CAMERA).unwrap();
    common::output(folder.path(), &["run", "camera.ron", "--out", "good", "--quiet"]);
    fs::read(folder.path().join("good/irradiance.exr")).unwrap()
}

/// What a PNG file says, and what it holds.
struct Png {
    width: u32,
    height: u32,
    depth: u8,
    color_type: u8,
    interlace: u8,
    /// Lines before they are compressed; gray of the size that is stated where there are none.
    lines: Option<Vec<u8>>,
    has_checksums: bool,
}

impl Default for Png {
    fn default() -> Self {
        Self { width: 4, height: 4, depth: 8, color_type: 2, interlace: 0, lines: None, has_checksums: true }
    }
}

fn png(png: &Png) -> Vec<u8> {
    let sizes = [png.width.to_be_bytes(), png.height.to_be_bytes()].concat();
    let header = [sizes, vec![png.depth, png.color_type, 0, 0, png.interlace]].concat();
    let gray = || [vec![0], vec![0x40; 3 * png.width as usize]].concat().repeat(png.height as usize);
    let lines = png.lines.clone().unwrap_or_else(gray);
    let chunk = |name: &[u8], content: &[u8]| {
        let body = [name, content].concat();
        let checksum = if png.has_checksums { crc32(&body) } else { 0 };
        [&(content.len() as u32).to_be_bytes()[..], &body, &checksum.to_be_bytes()].concat()
    };
    let start = b"\x89PNG\r\n\x1a\n".to_vec();
    [start, chunk(b"IHDR", &header), chunk(b"IDAT", &stored(&lines)), chunk(b"IEND", &[])].concat()
}

/// Returns bytes as a zlib stream without compression (RFC 1950 and 1951).
fn stored(bytes: &[u8]) -> Vec<u8> {
    let mut stream = vec![0x78, 0x01];
    let blocks: Vec<&[u8]> = bytes.chunks(0xffff).collect();
    for (n, block) in blocks.iter().enumerate() {
        let length = block.len() as u16;
        stream.push(u8::from(n + 1 == blocks.len()));
        stream.extend([length.to_le_bytes(), (!length).to_le_bytes()].concat());
        stream.extend_from_slice(block);
    }
    let (a, b) = bytes.iter().fold((1_u32, 0_u32), |(a, b), byte| {
        let a = (a + u32::from(*byte)) % 65521;
        (a, (b + a) % 65521)
    });
    stream.extend((b << 16 | a).to_be_bytes());
    stream
}

/// The checksum of PNG chunks (ISO 3309).
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |sum: u32, byte| {
        (0..8).fold(sum ^ u32::from(*byte), |sum, _| if sum & 1 == 1 { sum >> 1 ^ 0xedb8_8320 } else { sum >> 1 })
    })
}

/// Pictures that are none, and words of the answer.
pub(crate) fn pictures() -> Vec<(Vec<u8>, &'static str)> {
    let of = |change: &dyn Fn(&mut Png)| {
        let mut own = Png::default();
        change(&mut own);
        png(&own)
    };
    let sized = |width: u32, height: u32| {
        let lines = Some(vec![0; 100]);
        png(&Png { width, height, lines, ..Png::default() })
    };
    let words = |text: &[u8]| text.to_vec();
    vec![
        (sized(0, 4), "Invalid image dimensions"),
        (sized(0x7fff_ffff, 0x7fff_ffff), "limit exceeded"),
        (sized(u32::MAX, 2), "of memory and may take"),
        (sized(60_000, 60_000), "does not have enough data"),
        (of(&|png| png.depth = 3), "Invalid bit depth 3"),
        (of(&|png| png.color_type = 9), "Invalid color type 9"),
        (of(&|png| png.interlace = 7), "Unknown interlace method 7"),
        (of(&|png| png.has_checksums = false), "CRC error"),
        (of(&|png| png.lines = Some(vec![0, 1, 2])), "does not have enough data for image"),
        (of(&|png| png.lines = Some(vec![9; 52])), "Unknown filter method 9"),
        (of(&|png| png.color_type = 3), "Missing palette"),
        (of(&|_| {})[..60].to_vec(), "ends too early (truncated)"),
        (of(&|_| {})[..8].to_vec(), "ends too early (truncated)"),
        (vec![], "it is empty"),
        (words(b"no picture at all"), "s.png"),
        (words(b"\xff\xd8\xff\xe0\0\x10JFIF\0"), "ends too early (truncated)"),
        (words(b"II*\0\x08\0\0\0\xff\xff"), "ends too early (truncated)"),
        (words(b"\x76\x2f\x31\x01"), "s.png"),
    ]
}

/// Irradiance files that are none, and words of the answer.
pub(crate) fn irradiances() -> Vec<(Vec<u8>, &'static str)> {
    let good = irradiance();
    // Where the value of an attribute begins: its name, its type and its length stand before.
    let value_of = |attribute: &[u8]| {
        let at = good.windows(attribute.len()).position(|own| own == attribute).unwrap();
        at + attribute.len() + 4
    };
    let with = |at: usize, bytes: &[u8]| {
        let mut own = good.clone();
        own[at..at + bytes.len()].copy_from_slice(bytes);
        own
    };
    let window = |sides: [i32; 4]| with(value_of(b"dataWindow\0box2i\0"), &sides.map(i32::to_le_bytes).concat());
    let mut all = vec![
        (window([0, 0, 1 << 30, 1 << 30]), "data window"),
        (window([5, 5, 0, 0]), "cannot be read"),
        (window([i32::MIN, i32::MIN, i32::MAX, i32::MAX]), "data window"),
        (with(value_of(b"compression\0compression\0"), &[99]), "compression"),
        (with(4, &[0xff; 4]), "of a kind that is not read"),
        (with(0, b"XXXX"), "it is no OpenEXR, as its name says"),
    ];
    for n in [0, 3, 8, 40, 200, good.len() / 3, good.len() - 5] {
        all.push((good[..n].to_vec(), "light.exr: cannot be read: "));
    }
    all
}
