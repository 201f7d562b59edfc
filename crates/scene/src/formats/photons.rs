//! The energy of photons.

/// Planck's constant, J s, and the speed of light, m/s (exact in the SI).
const PLANCK_J_S: f64 = 6.626_070_15e-34;
const LIGHT_M_S: f64 = 299_792_458.0;

/// Returns the energy of a photon, J.
pub fn joules_per_photon(wavelength_nm: f64) -> f64 {
    1e9 * PLANCK_J_S * LIGHT_M_S / wavelength_nm
}
