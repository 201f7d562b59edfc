//! Words of world files: each is obeyed, or told.

use std::path::Path;

use dioptric_spectrum::Cancel;
use dioptric_world::{ReadOptions, World, WorldError, read_world};

fn read(folder: &Path, name: &str, bytes: &[u8]) -> Result<World, WorldError> {
    let path = folder.join(name);
    std::fs::write(&path, bytes).expect("a folder that can be written to");
    read_world(&path, &ReadOptions::default(), &Cancel::new())
}

/// A folder with a picture.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    std::fs::write(folder.path().join("picture.png"), include_bytes!("corpus/picture.png")).expect("a folder");
    folder
}

/// Directives of pbrt, and parameters with their values.
const LINES: [(&str, &[[&str; 2]]); 22] = [
    ("Shape \"sphere\"", &[["float radius", "1"], ["float zmin", "-1"], ["float phimax", "360"], ["float alpha", "1"]]),
    ("Shape \"disk\"", &[["float radius", "1"], ["float height", "0"], ["float innerradius", ".1"]]),
    ("Shape \"cylinder\"", &[["float radius", "1"], ["float zmin", "-1"], ["float zmax", "1"]]),
    (
        "Shape \"trianglemesh\"",
        &[["point3 P", "[0 0 0 1 0 0 0 1 0]"], ["integer indices", "[0 1 2]"], ["point2 uv", "[0 0 1 0 0 1]"]],
    ),
    (
        "LightSource \"point\"",
        &[["rgb I", "[1 1 1]"], ["point3 from", "[0 1 0]"], ["float scale", "1"], ["float power", "9"]],
    ),
    ("LightSource \"spot\"", &[["rgb I", "[1 1 1]"], ["point3 to", "[0 0 1]"], ["float coneangle", "30"]]),
    ("LightSource \"distant\"", &[["rgb L", "[1 1 1]"], ["point3 from", "[0 1 0]"], ["float illuminance", "3"]]),
    ("LightSource \"infinite\"", &[["rgb L", "[1 1 1]"], ["float scale", "1"], ["float illuminance", "3"]]),
    (
        "LightSource \"projection\"",
        &[["string filename", "\"picture.png\""], ["float fov", "40"], ["float scale", "2"], ["float power", "9"]],
    ),
    ("AreaLightSource \"diffuse\"", &[["rgb L", "[1 1 1]"], ["float scale", "2"], ["bool twosided", "true"]]),
    ("Material \"diffuse\"", &[["rgb reflectance", "[.5 .5 .5]"]]),
    (
        "Material \"conductor\"",
        &[["spectrum eta", "\"metal-Cu-eta\""], ["float roughness", ".1"], ["bool remaproughness", "true"]],
    ),
    ("Material \"dielectric\"", &[["float eta", "1.5"], ["float roughness", ".1"]]),
    (
        "Material \"subsurface\"",
        &[["rgb sigma_a", "[1 2 3]"], ["rgb sigma_s", "[3 2 1]"], ["float scale", "9"], ["float g", ".5"]],
    ),
    ("Material \"kdsubsurface\"", &[["rgb Kd", "[.5 .5 .5]"], ["float mfp", ".1"], ["float eta", "1.4"]]),
    (
        "Material \"hair\"",
        &[["float eumelanin", "1"], ["float beta_m", ".2"], ["float alpha", "3"], ["float eta", "1.5"]],
    ),
    (
        "Texture \"t\" \"spectrum\" \"imagemap\"",
        &[["string filename", "\"picture.png\""], ["string wrap", "\"clamp\""], ["string encoding", "\"linear\""]],
    ),
    (
        "Texture \"t\" \"spectrum\" \"checkerboard\"",
        &[["rgb tex1", "[1 1 1]"], ["integer dimension", "2"], ["float uscale", "3"]],
    ),
    ("Texture \"t\" \"float\" \"fbm\"", &[["integer octaves", "4"], ["float roughness", ".4"]]),
    ("Film \"rgb\"", &[["integer xresolution", "9"], ["integer yresolution", "6"]]),
    ("Camera \"perspective\"", &[["float fov", "40"], ["float lensradius", ".01"], ["float focaldistance", "3"]]),
    ("Integrator \"path\"", &[]),
];

/// A strange parameter, type, kind or value of each directive is told or refused, every time.
#[test]
fn strange_words_of_pbrt_are_told() {
    let folder = folder();
    for (directive, params) in LINES {
        let told = |head: &str, params: &[[&str; 2]]| {
            let params: String = params.iter().map(|[name, value]| format!(" \"{name}\" {value}")).collect();
            let camera = if head.starts_with("Camera") { "" } else { "Camera \"perspective\"\n" };
            let (before, after) = match head.split(' ').next() {
                Some("Film" | "Camera" | "Integrator") => (format!("{head}{params}\n"), String::new()),
                _ => (String::new(), format!("{head}{params}\n")),
            };
            let text = format!("{before}{camera}WorldBegin\n{after}LightSource \"infinite\"\nShape \"sphere\"\n");
            read(folder.path(), "a.pbrt", text.as_bytes()).map(|world| world.notes().join("\n"))
        };
        assert_eq!(told(directive, params).unwrap(), "", "{directive}");
        let kind = format!("{}quux\"", directive.strip_suffix('"').unwrap());
        if let Ok(notes) = told(&kind, params) {
            assert!(notes.contains("quux") || kind.starts_with("Camera"), "{kind}: {notes}");
        }
        let more = [params, &[["float quux", "3"]]].concat();
        assert!(told(directive, &more).unwrap().contains("quux"), "{directive}");
        for (number, [name, value]) in params.iter().enumerate() {
            let word = name.split(' ').nth(1).unwrap();
            let [of_blarg, of_texture, of_bool] = ["blarg", "texture", "bool"].map(|kind| format!("{kind} {word}"));
            let of_other = if value.starts_with('"') { "7" } else { "\"none\"" };
            for strange in [
                [&*of_blarg, value],
                [&of_texture, "\"none\""],
                [&of_bool, "\"maybe\""],
                [name, "[]"],
                [name, of_other],
                [name, if value.starts_with('"') { "\"quux\"" } else { "[-7 -8 -9 -10 -11]" }],
            ] {
                let mut params = params.to_vec();
                params[number] = strange;
                if let Ok(notes) = told(directive, &params) {
                    assert!(
                        [word, "quux", ": none", ": maybe"].iter().any(|said| notes.contains(said)),
                        "{directive} {strange:?}: '{notes}'"
                    );
                }
            }
        }
    }
}

/// Unknown words of meshes and their materials.
#[test]
fn strange_words_of_meshes_are_told() {
    let folder = folder();
    let told = |name: &str, text: &str| read(folder.path(), name, text.as_bytes()).unwrap().notes().join("\n");
    let triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    for (line, word) in [
        ("quux 3", "quux"),
        ("v 0 0 0 1 2", "numbers behind"),
        ("v 1 1 1 nan 0 0", "aren't numbers"),
        ("s blarg", "blarg"),
    ] {
        let notes = told("a.obj", &format!("{triangle}{line}\nf 1 2 3 # three\n"));
        assert!(notes.contains(word), "{line}: {notes}");
    }
    for (line, word) in [
        ("quux 3", "quux"),
        ("Kd 200 0 0", "Kd"),
        ("Kd red", "Kd"),
        ("Kd", "Kd"),
        ("map_Kd -quux 3 picture.png", "quux"),
        ("map_Ke picture.png", "glow"),
        ("map_Ks picture.png", "map_ks"),
        ("Tf 1 0 0", "go"),
        ("illum 3\nKs 1 1 1", "mirror"),
        ("map_Kd none.png", "none.png"),
    ] {
        std::fs::write(folder.path().join("a.mtl"), format!("Ns 3\nnewmtl m\n{line}\n")).unwrap();
        let notes = told("a.obj", &format!("mtllib a.mtl\nusemtl m\n{triangle}f 1 2 3\n"));
        // What stands before the first material belongs to none.
        assert!(notes.contains(word) && notes.contains("Ns"), "{line}: {notes}");
    }
    let header = "ply\nformat ascii 1.0\ncomment TextureFile none.png\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                  property float quux\nelement face 1\nproperty list uchar int vertex_indices\nproperty uchar blarg\nelement edge 0\n\
                  property int foo\nend_header\n0 0 0 1\n1 0 0 1\n0 1 0 1\n3 0 1 2 5\n";
    let notes = told("a.ply", header);
    assert!(["quux of vertex", "blarg of face", "foo of edge"].iter().all(|word| notes.contains(word)), "{notes}");
    let stl = "SOLID a\nquux 3\nfacet normal 0 0 1\nouter loop\nVertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n";
    let world = read(folder.path(), "a.stl", stl.as_bytes()).unwrap();
    assert_eq!((world.n_primitives(), world.notes().iter().any(|note| note.contains("quux"))), (1, true));
}
