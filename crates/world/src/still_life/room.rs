//! What stands where in the still life.

use glam::DVec3;

use super::{
    floor_plan::{BULBS, CLOTH_HALF, ROOM_CENTER, ROOM_HALF, WINDOW_CD_M2, WINDOW_HIGH, WINDOW_LOW},
    noise::unit,
    paint::{Glow, Paint},
    palette::{Frame, Light, Material, Object, Palette, glow, pattern},
    pigment::{Pigment, PigmentIndex},
};
use crate::{Lathe, Material as Surface, Shape, ShapeId, TriangleMesh, WorldBuilder};

/// Objects that belong together, and more of them.
type Things = Vec<Vec<Object>>;

/// Adds everything to a world.
pub(super) fn furnish(builder: &mut WorldBuilder) {
    let mut things = Vec::new();
    let walls = Frame { origin: ROOM_CENTER, ..Frame::at(0.0, 0.0, 0.0) };
    things.push(vec![block(ROOM_HALF.to_array(), walls, Material::Matte(Paint::Room))]);
    table(&mut things);
    front(&mut things);
    middle(&mut things);
    vase(&mut things);
    far_end(&mut things);
    chair(&mut things);
    back(&mut things);
    lamps(&mut things);
    let mut palette = Palette::default();
    for thing in things {
        let shapes: Vec<ShapeId> = thing.into_iter().map(|object| palette.stand(builder, object)).collect();
        builder.join(shapes);
    }
    window(builder, &mut palette);
    lamp_openings(builder, &mut palette);
}

/// The window in the left wall: two by three panes of sky.
fn window(builder: &mut WorldBuilder, palette: &mut Palette) {
    const PANES: (usize, usize) = (2, 3);
    /// Half the width of the bars, in widths and heights of a pane.
    const BARS: (f64, f64) = (0.035, 0.05);
    /// The panes stand before the wall by this, m.
    const BEFORE_M: f64 = 2e-3;
    let (low, size) = (ROOM_CENTER + WINDOW_LOW, WINDOW_HIGH - WINDOW_LOW);
    let (width, height) = (size.z / PANES.0 as f64, size.y / PANES.1 as f64);
    let reflectance = palette.curve(builder, Pigment::Ink.index(), None);
    let material = builder.add_material("window", Surface::Matte { reflectance });
    let by = pattern(builder, Glow::Window { low_m: low.y, height_m: size.y });
    builder.set_glow(material, by);
    let mut panes = Vec::new();
    for (column, row) in (0..PANES.0).flat_map(|column| (0..PANES.1).map(move |row| (column, row))) {
        let z = low.z + width * (column as f64 + BARS.0);
        let y = low.y + height * (row as f64 + BARS.1);
        let along_z = DVec3::Z * width * (1.0 - 2.0 * BARS.0);
        let along_y = DVec3::Y * height * (1.0 - 2.0 * BARS.1);
        // In the frame of the room, y up; the normal, y × z, points into the room.
        let (corner, sides) = (DVec3::new(low.x + BEFORE_M, y, z), [along_y, along_z]);
        let z_up = |v: DVec3| DVec3::new(v.x, -v.z, v.y).as_vec3();
        let quad = TriangleMesh::quad(z_up(corner), z_up(sides[0]), z_up(sides[1]));
        let emission = glow(Light::Day, WINDOW_CD_M2, false);
        let pane = builder.add_shape(Shape::Mesh(quad), Frame::at(0.0, 0.0, 0.0).place(), material, Some(emission));
        panes.push(pane);
    }
    builder.join(panes);
}

/// The light that comes out of the shaded lamp above and below its shade.
fn lamp_openings(builder: &mut WorldBuilder, palette: &mut Palette) {
    let shaded = &BULBS[1];
    let material = palette.material(builder, Material::plain(Pigment::Linen.index()));
    for (height_m, radius_m, is_up) in [(0.196, 0.120, false), (0.399, 0.078, true)] {
        let frame = Frame::at(shaded.center.x, height_m, shaded.center.z);
        let disc = Shape::Disc { radius_m, inner_radius_m: 0.0 };
        let emission = glow(Light::Warm, shaded.luminance, false);
        let disc = builder.add_shape(disc, frame.place(), material, Some(emission));
        if !is_up {
            builder.reverse(disc);
        }
    }
}

fn object(shape: Shape, frame: Frame, material: Material) -> Object {
    Object { shape, frame, material }
}

fn block([x, y, z]: [f64; 3], frame: Frame, material: Material) -> Object {
    let half = DVec3::new(x, z, y).as_vec3();
    object(Shape::Mesh(TriangleMesh::block(-half, half)), frame, material)
}

fn smooth(profile: &[[f64; 2]]) -> Lathe {
    Lathe::smooth(profile).expect("heights ascend")
}

fn turned(profile: &[[f64; 2]], frame: Frame, material: Material) -> Object {
    object(Shape::Lathe(smooth(profile)), frame, material)
}

fn rimmed(profile: &[[f64; 2]], [y, inner, outer]: [f64; 3], frame: Frame, material: Material) -> Object {
    let lathe = smooth(profile).with_ring(y, inner, outer).expect("a ring has a width");
    object(Shape::Lathe(lathe), frame, material)
}

fn cone(profile: &[[f64; 2]], frame: Frame, material: Material) -> Object {
    object(Shape::Lathe(Lathe::cones(profile).expect("heights ascend")), frame, material)
}

fn ball(radius_m: f64, frame: Frame, material: Material) -> Object {
    object(Shape::Sphere { radius_m }, frame, material)
}

const DIE: Material = Material::Coated { paint: Paint::Die, index: 1.54, alpha: 0.0 };
const PEAR: Material = Material::Coated { paint: Paint::Pear, index: 1.46, alpha: 0.045 };
const LEMON: Material = Material::Coated { paint: Paint::Lemon, index: 1.54, alpha: 0.02 };
const ORANGE: Material = Material::Coated { paint: Paint::Orange, index: 1.54, alpha: 0.02 };

fn apple_skin(seed: u8) -> Material {
    Material::Coated { paint: Paint::Apple { seed }, index: 1.5, alpha: 0.0 }
}

fn table(things: &mut Things) {
    things.push(vec![block(
        [1.0, 0.02, 0.82],
        Frame::at(0.05, -0.02, 1.24),
        Material::Coated { paint: Paint::Planks, index: 1.46, alpha: 0.035 },
    )]);
    let cloth = Frame::at(-0.02, CLOTH_HALF.y, 1.12).turned_deg(16.0);
    things.push(vec![block(CLOTH_HALF.to_array(), cloth, Material::Matte(Paint::Cloth))]);
}

/// What lies nearest: dice, marbles, a steel ball.
fn front(things: &mut Things) {
    let die = |x: f64, z: f64, turn: f64| block([0.008; 3], Frame::at(x, 0.0104, z).turned_deg(turn), DIE);
    things.push(vec![die(0.062, 0.80, 24.0), die(0.094, 0.835, -38.0)]);
    let marble =
        |x: f64, z: f64, pigment: Pigment| ball(0.0085, Frame::at(x, 0.0085, z), Material::glossy(pigment.index()));
    things.push(vec![
        marble(-0.176, 0.795, Pigment::Teal),
        marble(-0.146, 0.812, Pigment::Crimson),
        marble(-0.187, 0.838, Pigment::Lemon),
    ]);
    let silver = Material::Metal(Pigment::Silver.index());
    things.push(vec![ball(0.027, Frame::at(-0.082, 0.0294, 0.845), silver)]);
}

/// Where the eye goes: fruit, the chart, the card.
fn middle(things: &mut Things) {
    apple(things, [-0.158, 0.995], 0, 12.0);
    apple(things, [0.048, 1.045], 1, -20.0);
    let pear = [
        [0.0, 0.012],
        [0.008, 0.024],
        [0.028, 0.0345],
        [0.045, 0.034],
        [0.062, 0.026],
        [0.078, 0.0175],
        [0.090, 0.0135],
        [0.097, 0.008],
        [0.0995, 0.0],
    ];
    let stem = [[0.0, 0.0018], [0.022, 0.0013], [0.024, 0.0020]];
    let at = Frame::at(-0.052, 0.0024, 1.060).tipped_deg(-4.0);
    let top = Frame { origin: at.origin + at.rotation * DVec3::new(0.0, 0.097, 0.0), ..at.tipped_deg(14.0) };
    things.push(vec![turned(&pear, at, PEAR), cone(&stem, top, Material::plain(Pigment::Twig.index()))]);
    let lemon = [
        [-0.043, 0.0],
        [-0.041, 0.0045],
        [-0.036, 0.0080],
        [-0.027, 0.0185],
        [-0.012, 0.0255],
        [0.002, 0.0265],
        [0.018, 0.0225],
        [0.030, 0.0125],
        [0.036, 0.0062],
        [0.039, 0.0],
    ];
    let lying = Frame::at(-0.005, 0.0280, 0.905).turned_deg(28.0).tipped_deg(82.0);
    things.push(vec![turned(&lemon, lying, LEMON)]);
    things.push(vec![ball(0.037, Frame::at(-0.205, 0.0385, 1.075), ORANGE)]);

    // The chart leans on a wooden stand.
    let leaning = Frame::at(0.315, 0.082, 1.42).turned_deg(13.0).leaning_deg(11.0);
    let foot = Frame::at(0.315, 0.0, 1.42).turned_deg(13.0);
    let on_foot = |x: f64, y: f64, z: f64| Frame { origin: foot.origin + foot.rotation * DVec3::new(x, y, z), ..foot };
    things.push(vec![
        block([0.107, 0.073, 0.003], leaning, Material::Matte(Paint::Chart)),
        block([0.085, 0.005, 0.020], on_foot(0.0, 0.005, -0.008), Material::WALNUT),
        block([0.006, 0.060, 0.004], on_foot(-0.05, 0.060, 0.022).leaning_deg(-14.0), Material::WALNUT),
        block([0.006, 0.060, 0.004], on_foot(0.05, 0.060, 0.022).leaning_deg(-14.0), Material::WALNUT),
    ]);

    // The card stands in a slotted block.
    let card = Frame::at(-0.292, 0.088, 1.20).turned_deg(-14.0).leaning_deg(8.0);
    let slot = Frame::at(-0.292, 0.008, 1.192).turned_deg(-14.0);
    things.push(vec![
        block([0.056, 0.078, 0.0006], card, Material::Matte(Paint::Card)),
        block([0.040, 0.008, 0.014], slot, Material::WALNUT),
    ]);
}

fn apple(things: &mut Things, [x, z]: [f64; 2], seed: u8, turn_deg: f64) {
    let outer = [
        [0.0, 0.014],
        [0.004, 0.021],
        [0.016, 0.0315],
        [0.032, 0.0378],
        [0.046, 0.0375],
        [0.058, 0.0315],
        [0.0645, 0.0225],
        [0.0665, 0.0150],
    ];
    let dimple = [[0.0520, 0.0], [0.0540, 0.0035], [0.0600, 0.0085], [0.0645, 0.0122], [0.0665, 0.0150]];
    let stem = [[0.0, 0.0011], [0.022, 0.0009], [0.026, 0.0017]];
    let at = Frame::at(x, 0.0024, z).turned_deg(turn_deg).tipped_deg(6.0);
    let top = Frame { origin: at.origin + at.rotation * DVec3::new(0.0, 0.052, 0.0), ..at.tipped_deg(12.0) };
    things.push(vec![
        turned(&outer, at, apple_skin(seed)),
        turned(&dimple, at, apple_skin(seed)),
        cone(&stem, top, Material::plain(Pigment::Twig.index())),
    ]);
}

/// A vase with twigs of berries.
fn vase(things: &mut Things) {
    let profile = [
        [0.0, 0.034],
        [0.006, 0.036],
        [0.030, 0.047],
        [0.070, 0.0655],
        [0.110, 0.0700],
        [0.150, 0.0570],
        [0.180, 0.0375],
        [0.203, 0.0295],
        [0.215, 0.0305],
        [0.224, 0.0375],
    ];
    let inner = [[0.12, 0.050], [0.180, 0.0345], [0.203, 0.0265], [0.215, 0.0275], [0.224, 0.0345]];
    let at = Frame::at(0.165, 0.0, 1.27);
    let mut objects = vec![
        rimmed(
            &profile,
            [0.224, 0.0345, 0.0375],
            at,
            Material::Coated { paint: Paint::Vase, index: 1.576, alpha: 0.0 },
        ),
        turned(&inner, at, Material::glossy(Pigment::Porcelain.index())),
    ];
    let mouth = DVec3::new(0.165, 0.21, 1.27);
    for twig in 0..7_i64 {
        let angle = std::f64::consts::TAU * (twig as f64 + 0.35 * unit(twig, 1, 1)) / 7.0;
        let lean = 0.16 + 0.20 * unit(twig, 2, 1);
        let length = 0.11 + 0.08 * unit(twig, 3, 1);
        grow(&mut objects, mouth, [angle, lean, length], twig);
    }
    things.push(objects);
}

/// Adds a twig of bent pieces with berries and leaves along it.
fn grow(objects: &mut Vec<Object>, mouth: DVec3, [angle, lean, length]: [f64; 3], twig: i64) {
    const PIECES: i64 = 5;
    let outward = DVec3::new(angle.cos(), 0.0, angle.sin());
    let mut from = mouth + 0.012 * outward;
    for piece in 0..PIECES {
        let bend = lean * (0.7 + 0.5 * piece as f64) + 0.16 * (unit(twig, piece, 4) - 0.5);
        let sideways = DVec3::new(-angle.sin(), 0.0, angle.cos()) * (0.5 * (unit(twig, piece, 5) - 0.5));
        let direction = (DVec3::Y * bend.cos() + outward * bend.sin() + sideways).normalize();
        let to = from + direction * length / PIECES as f64;
        let thickness = 0.0016 - 0.00022 * piece as f64;
        let part = [[0.0, thickness], [from.distance(to), thickness - 0.0002]];
        objects.push(cone(&part, Frame::along(from, to), Material::plain(Pigment::Twig.index())));
        if piece >= 1 {
            for berry in 0..2 {
                let turn = std::f64::consts::TAU * unit(twig, 7 * piece + berry, 6);
                let off = DVec3::new(turn.cos(), 0.35, turn.sin()) * 0.0085;
                let center = from.lerp(to, 0.25 + 0.5 * berry as f64) + off;
                let radius = 0.0040 + 0.0016 * unit(twig, piece, 7 + berry);
                let frame = Frame { origin: center, ..Frame::at(0.0, 0.0, 0.0) };
                objects.push(ball(radius, frame, Material::glossy(Pigment::Berry.index())));
            }
        }
        from = to;
    }
}

/// The far end of the table: books, a candle, a mug of pencils, a bottle.
fn far_end(things: &mut Things) {
    let covers = [(Pigment::Crimson, 0.016, 4.0), (Pigment::Teal, 0.013, -7.0), (Pigment::Ochre, 0.011, 10.0)];
    let mut y = 0.0;
    let mut books = Vec::new();
    for (pigment, half_height, turn) in covers {
        let at = Frame::at(-0.27, y + half_height, 1.72).turned_deg(turn);
        let place =
            |dx: f64, dy: f64, dz: f64| Frame { origin: at.origin + at.rotation * DVec3::new(dx, dy, dz), ..at };
        let cloth = Material::glossy(pigment.index());
        books.push(block([0.105, half_height - 0.003, 0.072], place(0.0, 0.0, 0.002), Material::Matte(Paint::Pages)));
        books.push(block([0.110, 0.0015, 0.076], place(0.0, half_height - 0.0015, 0.0), cloth));
        books.push(block([0.110, 0.0015, 0.076], place(0.0, 0.0015 - half_height, 0.0), cloth));
        books.push(block([0.110, half_height, 0.002], place(0.0, 0.0, -0.075), cloth));
        y += 2.0 * half_height;
    }
    things.push(books);

    let brass = Material::Metal(Pigment::Brass.index());
    let stick = [
        [0.0, 0.047],
        [0.004, 0.046],
        [0.010, 0.020],
        [0.022, 0.0085],
        [0.040, 0.0130],
        [0.055, 0.0075],
        [0.080, 0.0070],
        [0.092, 0.0150],
        [0.098, 0.0155],
    ];
    let on_books = Frame::at(-0.285, y, 1.72);
    let candle = Frame { origin: on_books.origin + DVec3::new(0.0, 0.098, 0.0), ..on_books };
    let wick = Frame { origin: candle.origin + DVec3::new(0.0, 0.128, 0.0), ..candle };
    things.push(vec![
        rimmed(&stick, [0.098, 0.0, 0.0155], on_books, brass),
        turned(
            &[[0.0, 0.0105], [0.05, 0.0105], [0.120, 0.0103], [0.127, 0.0085], [0.130, 0.0]],
            candle,
            Material::Coated { paint: Paint::Plain(Pigment::Wax.index()), index: 1.42, alpha: 0.055 },
        ),
        cone(&[[0.0, 0.0010], [0.012, 0.0008]], wick, Material::plain(Pigment::Charcoal.index())),
    ]);
    pencils(things);

    let bottle = [
        [0.0, 0.034],
        [0.004, 0.0370],
        [0.012, 0.0372],
        [0.150, 0.0372],
        [0.175, 0.0345],
        [0.200, 0.0215],
        [0.222, 0.0150],
        [0.270, 0.0138],
        [0.276, 0.0138],
    ];
    let at = Frame::at(0.010, 0.0, 1.86);
    let capsule = [[0.262, 0.0145], [0.290, 0.0145]];
    things.push(vec![
        turned(&bottle, at, Material::Bottle),
        cone(&capsule, at, Material::glossy(Pigment::Crimson.index())),
    ]);
}

/// A mug of pencils.
fn pencils(things: &mut Things) {
    let at = Frame::at(-0.105, 0.0, 1.52);
    let outside = [[0.0, 0.036], [0.003, 0.0385], [0.050, 0.0405], [0.092, 0.0415]];
    let inside = [[0.004, 0.036], [0.050, 0.0375], [0.092, 0.0385]];
    let glaze = Material::glossy(Pigment::Teal.index());
    let mut objects = vec![rimmed(&outside, [0.092, 0.0385, 0.0415], at, glaze), turned(&inside, at, glaze)];
    let pigments: [PigmentIndex; 6] = [
        Pigment::Lemon.index(),
        Pigment::Crimson.index(),
        Pigment::patch(12),
        Pigment::patch(13),
        Pigment::Orange.index(),
        Pigment::patch(16),
    ];
    for (i, pigment) in pigments.into_iter().enumerate() {
        let angle = std::f64::consts::TAU * (i as f64 + 0.3) / 6.0;
        let foot = at.origin + DVec3::new(-0.020 * angle.cos(), 0.006, -0.020 * angle.sin());
        let tip = at.origin + DVec3::new(0.055 * angle.cos(), 0.170, 0.045 * angle.sin());
        let pencil = [[0.0, 0.0037], [0.152, 0.0037], [0.173, 0.0002]];
        objects.push(cone(
            &pencil,
            Frame::along(foot, tip),
            Material::Coated { paint: Paint::Pencil(pigment), index: 1.54, alpha: 0.0 },
        ));
    }
    things.push(objects);
}

/// The back of a chair between the table and the wall.
fn chair(things: &mut Things) {
    let at = Frame::at(-0.62, 0.0, 2.55).turned_deg(-18.0);
    let place = |x: f64, y: f64| Frame { origin: at.origin + at.rotation * DVec3::new(x, y, 0.0), ..at };
    let mut parts = vec![
        block([0.017, 0.52, 0.017], place(-0.21, -0.27), Material::WALNUT),
        block([0.017, 0.52, 0.017], place(0.21, -0.27), Material::WALNUT),
        block([0.225, 0.034, 0.012], place(0.0, 0.205), Material::WALNUT),
        block([0.195, 0.016, 0.009], place(0.0, -0.06), Material::WALNUT),
    ];
    parts.extend((-2..=2).map(|i| block([0.010, 0.125, 0.006], place(0.075 * f64::from(i), 0.065), Material::WALNUT)));
    things.push(parts);
}

/// The wall at the back: a sideboard with books and a lamp, a picture, a string of lights.
fn back(things: &mut Things) {
    things.push(vec![
        block([1.55, 0.022, 0.20], Frame::at(0.1, -0.012, 3.76), Material::WALNUT),
        block([1.50, 0.36, 0.18], Frame::at(0.1, -0.39, 3.78), Material::WALNUT),
    ]);
    let spines = [
        (Pigment::Crimson.index(), 0.115),
        (Pigment::patch(12), 0.100),
        (Pigment::Ochre.index(), 0.128),
        (Pigment::Linen.index(), 0.094),
        (Pigment::Teal.index(), 0.118),
        (Pigment::patch(9), 0.106),
        (Pigment::Indigo.index(), 0.132),
        (Pigment::Leaf.index(), 0.109),
        (Pigment::patch(14), 0.122),
        (Pigment::Paper.index(), 0.098),
        (Pigment::patch(7), 0.126),
        (Pigment::Berry.index(), 0.112),
        (Pigment::Charcoal.index(), 0.119),
        (Pigment::patch(11), 0.103),
    ];
    let mut x = -0.78;
    let mut books = Vec::new();
    for (i, (pigment, half_height)) in spines.into_iter().enumerate() {
        let half_width = 0.011 + 0.012 * unit(i as i64, 21, 2);
        x += half_width;
        let material = Material::Coated { paint: Paint::Spine { pigment, seed: i as u8 }, index: 1.42, alpha: 0.075 };
        books.push(block([half_width, half_height, 0.075], Frame::at(x, 0.010 + half_height, 3.76), material));
        x += half_width + 0.0015;
    }
    things.push(books);
    let bowl = [[0.0, 0.045], [0.010, 0.050], [0.045, 0.105], [0.075, 0.128]];
    things.push(vec![
        rimmed(&bowl, [0.068, 0.0, 0.12], Frame::at(0.25, 0.010, 3.70), Material::glossy(Pigment::Cobalt.index())),
        ball(0.042, Frame::at(0.205, 0.115, 3.69), ORANGE),
        ball(0.040, Frame::at(0.295, 0.113, 3.68), ORANGE),
        ball(0.041, Frame::at(0.252, 0.135, 3.73), ORANGE),
    ]);
    let picture = Frame::at(0.28, 0.55, 3.985);
    let side = |x: f64, y: f64| Frame { origin: picture.origin + DVec3::new(x, y, -0.012), ..picture };
    things.push(vec![
        block([0.265, 0.205, 0.004], picture, Material::Matte(Paint::Picture)),
        block([0.015, 0.225, 0.014], side(-0.275, 0.0), Material::WALNUT),
        block([0.015, 0.225, 0.014], side(0.275, 0.0), Material::WALNUT),
        block([0.290, 0.015, 0.014], side(0.0, 0.215), Material::WALNUT),
        block([0.290, 0.015, 0.014], side(0.0, -0.215), Material::WALNUT),
    ]);
}

/// The lamps themselves, and a string of small ones along the wall.
fn lamps(things: &mut Things) {
    let pendant = Material::Lamp(BULBS[0].luminance);
    things.push(vec![ball(BULBS[0].radius, Frame { origin: BULBS[0].center, ..Frame::at(0.0, 0.0, 0.0) }, pendant)]);

    let foot = Frame { origin: DVec3::new(BULBS[1].center.x, 0.010, BULBS[1].center.z), ..Frame::at(0.0, 0.0, 0.0) };
    let body = [
        [0.0, 0.060],
        [0.008, 0.058],
        [0.020, 0.022],
        [0.050, 0.042],
        [0.095, 0.058],
        [0.140, 0.030],
        [0.170, 0.010],
        [0.200, 0.009],
    ];
    let shade = [[0.185, 0.135], [0.390, 0.085]];
    let on_shade = Frame { origin: foot.origin + DVec3::new(0.0, 0.185, 0.0), ..foot };
    let shade = Lathe::cones(&shade.map(|[y, r]| [y - 0.185, r])).expect("heights ascend").without_lids();
    things.push(vec![
        turned(&body, foot, Material::glossy(Pigment::Ochre.index())),
        object(Shape::Lathe(shade), on_shade, Material::Shade(620.0)),
    ]);

    let string = |x: f64| 0.60 + 0.030 * (x + 0.45).powi(2) * 4.0 - 0.055 * (4.2 * (x + 0.2)).cos().powi(2);
    let lights = (0..13).map(|i| {
        let x = -1.30 + 0.098 * f64::from(i) + 0.02 * unit(i64::from(i), 4, 4);
        let frame = Frame::at(x, string(x), 3.90 + 0.03 * unit(i64::from(i), 9, 9));
        ball(0.0065, frame, Material::Lamp(6_000.0))
    });
    things.push(lights.collect());
}
