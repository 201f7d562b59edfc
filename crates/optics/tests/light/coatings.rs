//! Thin films against tmm (S. Byrnes, on `PyPI`), which solves them by scattering matrices.

use dioptric_optics::Film;
use num_complex::Complex64;

#[test]
fn random_stacks_are_those_of_tmm() {
    let rows = include_str!("tmm.csv").lines().filter(|line| !line.starts_with('#')).skip(1);
    let mut n_rows = 0;
    for row in rows {
        let cells: Vec<&str> = row.split(',').collect();
        let number = |i: usize| cells[i].parse::<f64>().unwrap();
        let layer = |words: &str| {
            let numbers: Vec<f64> = words.split(' ').map(|word| word.parse().unwrap()).collect();
            (Complex64::new(numbers[0], numbers[1]), numbers[2])
        };
        let layers: Vec<_> = cells[1].split(';').filter(|words| !words.is_empty()).map(layer).collect();
        let film = Film::new(number(0), &layers, Complex64::new(number(2), number(3)), number(4));
        let found = film.shares(number(5).to_radians().cos());
        for (found, expected) in [found.r_s, found.r_p, found.t_s, found.t_p].into_iter().zip((6..10).map(number)) {
            assert!((found - expected).abs() < 1e-12, "{row}: {found}, expected {expected}");
        }
        n_rows += 1;
    }
    assert_eq!(n_rows, 40);
}
