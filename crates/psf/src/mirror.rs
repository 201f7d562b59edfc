//! Fields of a grid whose images are mirror images of each other.

use glam::DVec2;

use crate::{
    mesh::Mesh,
    ray_map::{RayMap, Sample},
};

/// The mirror image of another sample: that of the field with its x, its y or both of the other sign.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Source {
    /// Which of the traced samples.
    traced: usize,
    /// Whether x changes its sign, and whether y does.
    flips: [bool; 2],
}

/// A grid of fields of which some need not be traced, because the lens is its own mirror image.
#[derive(Clone, Debug)]
pub(crate) struct MirroredFields {
    traced: Vec<DVec2>,
    /// One a field, x innermost.
    sources: Vec<Source>,
}

/// How far two tangents that are meant to be of the same size may differ, over the widest.
const ROUNDING: f64 = 1e-12;

impl MirroredFields {
    /// Finds the fields to trace: of each pair of mirror images the one with the smaller index.
    ///
    /// `symmetries` are those of [`Lens::mirror_symmetries`](dioptric_optics::Lens::mirror_symmetries).
    pub(crate) fn new(symmetries: [bool; 2], mesh: Mesh, tans_x: &[f64], tans_y: &[f64]) -> Self {
        // Of an odd number of azimuths the ring's nodes are not mirrored onto nodes when x changes its sign.
        let x = images(tans_x, symmetries[0] && mesh.n_azimuths.is_multiple_of(2));
        let y = images(tans_y, symmetries[1]);
        let (n_x, n_y) = (tans_x.len(), tans_y.len());
        let (mut traced, mut places, mut sources) = (vec![], vec![0; n_x * n_y], vec![]);
        for (row, &tan_y) in tans_y.iter().enumerate() {
            for (column, &tan_x) in tans_x.iter().enumerate() {
                let of = y[row] * n_x + x[column];
                let flips = [x[column] != column, y[row] != row];
                if flips == [false; 2] {
                    places[of] = traced.len();
                    traced.push(DVec2::new(tan_x, tan_y));
                }
                sources.push(Source { traced: places[of], flips });
            }
        }
        Self { traced, sources }
    }

    /// The fields to trace, in order.
    pub(crate) fn traced(&self) -> impl Iterator<Item = DVec2> {
        self.traced.iter().copied()
    }

    /// Returns the samples of all fields from those that were traced.
    pub(crate) fn spread<'a>(&'a self, traced: &'a [Option<Sample>]) -> impl Iterator<Item = Option<Sample>> + 'a {
        self.sources.iter().map(|source| Some(traced[source.traced].as_ref()?.mirrored(source.flips)))
    }
}

/// Returns for each of these tangents the index of the one that it is the mirror image of, or its own.
fn images(tans: &[f64], is_mirrored: bool) -> Vec<usize> {
    let widest = tans.iter().fold(0.0_f64, |widest, tan| widest.max(tan.abs()));
    let image = |(i, tan): (usize, &f64)| {
        let of = tans[..i].iter().position(|other| is_mirrored && (other + tan).abs() <= ROUNDING * widest);
        of.unwrap_or(i)
    };
    tans.iter().enumerate().map(image).collect()
}

impl Sample {
    /// Returns the sample of the field that is the mirror image of this one's, x or y or both of the other sign.
    fn mirrored(&self, flips: [bool; 2]) -> Self {
        if flips == [false; 2] {
            return self.clone();
        }
        let sign = DVec2::from(flips.map(|is_flipped| if is_flipped { -1.0 } else { 1.0 }));
        let (mut record, mut summary) = (self.record.mirrored(flips), self.summary);
        // A cell is drawn as two triangles, and its mirror image is cut along its other diagonal.
        let moved_mm = record.recenter();
        summary.centroid_mm = sign * summary.centroid_mm + moved_mm;
        Self { record, summary }
    }
}

impl RayMap {
    /// Returns the map with x or y or both of the other sign, in the pupil, in the stop and on the film.
    fn mirrored(&self, flips: [bool; 2]) -> Self {
        let n = self.mesh.n_azimuths;
        // Node j lies at the azimuth 2π j/n, cell j between it and the next.
        let (mut node, mut cell): (Vec<usize>, Vec<usize>) = ((0..n).collect(), (0..n).collect());
        if flips[0] {
            node.iter_mut().for_each(|j| *j = (n + n / 2 - *j) % n);
            cell.iter_mut().for_each(|j| *j = (n + n / 2 - 1 - *j) % n);
        }
        if flips[1] {
            node.iter_mut().for_each(|j| *j = (n - *j) % n);
            cell.iter_mut().for_each(|j| *j = n - 1 - *j);
        }
        let n_cells = self.mesh.n_cells();
        let (lists, energies) = self.numbers.split_at(self.numbers.len() - n_cells);
        let mut numbers = Vec::with_capacity(self.numbers.len());
        for (list, places) in lists.chunks_exact(self.mesh.n_nodes()).enumerate() {
            let sign = if Self::is_reversed(list, flips) { -1.0 } else { 1.0 };
            numbers.push(sign * places[0]);
            numbers.extend(places[1..].chunks_exact(n).flat_map(|ring| node.iter().map(move |&j| sign * ring[j])));
        }
        numbers.extend(energies.chunks_exact(n).flat_map(|ring| cell.iter().map(move |&j| ring[j])));
        Self { numbers, ..*self }
    }
}

#[cfg(test)]
mod tests {
    use dioptric_optics::{CoordinateBreak, Lens};
    use dioptric_spectrum::Cancel;

    use super::*;
    use crate::{BankSettings, Diffraction, general::GeneralBank};

    fn tilted(tilt_deg: [f64; 3]) -> Lens {
        let lens = Lens::built_in("dgauss-50mm").unwrap().with_f_number(4.0, 550.0).unwrap();
        let last = lens.interfaces().len() - 1;
        let moves = vec![CoordinateBreak {
            surfaces: (0, last),
            pivot_mm: 20.0,
            decenter_mm: [0.0; 3],
            tilt_deg,
            tilt_first: false,
        }];
        lens.with_moves(moves).unwrap()
    }

    fn settings() -> BankSettings {
        let corners = (DVec2::new(-0.3, -0.2), DVec2::new(0.3, 0.2));
        let grid = BankSettings::covering_grid(52.0, corners, (0.2, 1.0), (450.0, 650.0), Diffraction::default());
        BankSettings { n_rings: 8, n_azimuths: 32, ..grid.coarse() }
    }

    #[test]
    fn symmetries_are_those_of_the_moves() {
        for (tilt_deg, symmetries) in [
            ([0.0, 0.0, 0.0], [true, true]),
            ([4.0, 0.0, 0.0], [true, false]),
            ([0.0, 4.0, 0.0], [false, true]),
            ([4.0, 4.0, 0.0], [false, false]),
        ] {
            assert_eq!(tilted(tilt_deg).mirror_symmetries(), symmetries, "{tilt_deg:?}");
        }
    }

    /// A turn of a billionth of a degree moves nothing by a nanometre, and leaves no symmetry.
    #[test]
    fn mirror_images_are_what_tracing_gives() {
        for (tilt_deg, spoilt_deg, share) in [
            ([4.0, 0.0, 0.0], [4.0, 1e-9, 0.0], 2),
            ([0.0, 4.0, 0.0], [1e-9, 4.0, 0.0], 2),
            ([0.0; 3], [1e-9, 1e-9, 0.0], 4),
        ] {
            let settings = settings();
            let of = |tilt_deg| GeneralBank::build(&tilted(tilt_deg), &settings, &|_| {}, &Cancel::new()).unwrap();
            let (mirrored, traced) = (of(tilt_deg), of(spoilt_deg));
            let (tans_x, tans_y) = settings.fields.axes();
            let mesh = Mesh { n_rings: 8, n_azimuths: 32 };
            let fields = |lens: Lens| MirroredFields::new(lens.mirror_symmetries(), mesh, tans_x, tans_y);
            assert_eq!(fields(tilted(tilt_deg)).traced().count() * share, settings.fields.len());
            assert_eq!(fields(tilted(spoilt_deg)).traced().count(), settings.fields.len());
            assert_eq!(mirrored.samples.len(), traced.samples.len());
            for (a, b) in mirrored.samples.iter().zip(&traced.samples) {
                let (Some(a), Some(b)) = (a, b) else { panic!("every field is lit") };
                let apart_mm = a.summary.centroid_mm.distance(b.summary.centroid_mm);
                // The pupil's center is found to 2e-3 of its radius, from where the search began.
                assert!(apart_mm < 2e-5, "{apart_mm} mm");
                let (rms_a, rms_b) = (a.record.rms_mm(), b.record.rms_mm());
                assert!((rms_a / rms_b - 1.0).abs() < 1e-3, "{rms_a} {rms_b} mm");
                let farthest =
                    |of: &dyn Fn(usize) -> DVec2| (0..mesh.n_nodes()).map(|i| of(i).length()).fold(0.0, f64::max);
                let size_mm = farthest(&|i| b.record.node(i).at_mm);
                let far_mm = farthest(&|i| a.record.node(i).at_mm - b.record.node(i).at_mm);
                assert!(far_mm < 4e-3 * size_mm, "{far_mm} of {size_mm} mm");
                let bends = farthest(&|i| b.record.node(i).along_l_mm);
                for of in [|node: crate::ray_map::Node| node.along_l_mm, |node: crate::ray_map::Node| node.along_m_mm] {
                    let far = farthest(&|i| of(a.record.node(i)) - of(b.record.node(i)));
                    assert!(far < 4e-3 * bends, "{far} of {bends}");
                }
                assert!(farthest(&|i| a.record.node(i).in_stop - b.record.node(i).in_stop) < 4e-3);
            }
        }
    }

    #[test]
    fn grids_that_are_not_about_the_axis_are_traced_whole() {
        let mesh = Mesh { n_rings: 2, n_azimuths: 8 };
        let fields =
            |mesh, tans_x: &[f64]| MirroredFields::new([true, true], mesh, tans_x, &[0.1, 0.2]).traced().count();
        assert_eq!(fields(mesh, &[-0.3, 0.0, 0.3]), 4);
        assert_eq!(fields(mesh, &[-0.3, 0.0, 0.2]), 6);
        // An odd number of nodes on a ring.
        assert_eq!(fields(Mesh { n_azimuths: 9, ..mesh }, &[-0.3, 0.0, 0.3]), 6);
    }
}
