//! Physical parameters of a surface from its point in the latent space.

use super::construction::Construction;
use super::embedding::{DIMENSIONS, Latent, MATERIALS};

/// Names of the materials in label order (Tulbure and Bäuml, Humanoids 2018).
pub const NAMES: [&str; MATERIALS] = [
    "synthetic leather rough",
    "synthetic leather smooth reverse",
    "synthetic leather smooth",
    "metallic jersey",
    "cotton fabric reverse",
    "cotton fabric",
    "linen fabric smooth reverse",
    "velours paper reverse",
    "linen fabric smooth",
    "wood",
    "white metal",
    "reflecting fabric reverse",
    "reflecting fabric",
    "metal",
    "plastic smooth",
    "latex",
    "silicon",
    "jersey",
    "velours paper",
    "wallpaper",
    "plastic rough",
    "spun fleece",
    "synthetic leather rough reverse",
    "cork",
    "linen fabric rough",
    "gunny",
    "carton",
    "denim",
    "carpet rough",
    "carpet smooth",
    "metallic grid",
    "rubber rough vertical",
    "rubber smooth",
    "rubber rough horizontal",
    "foam",
    "neoprene",
];

/// Number of bands of the texture, each an Ornstein-Uhlenbeck process.
pub(super) const BANDS: usize = 4;

/// Physical parameters of a surface; amplitudes are relative to the level of the taxel.
#[derive(Debug, Clone)]
pub(super) struct Surface {
    /// Standard deviation of each band of the texture.
    pub(super) amplitudes: [f64; BANDS],
    /// Correlation time of each band at 3 cm/s, steps.
    pub(super) correlation_steps: [f64; BANDS],
    /// Variance of the noise per digit of level.
    pub(super) grain_variance: f64,
    /// Factor on the texture of each row of taxels, which depends on the curvature of the fingertip.
    pub(super) row_gains: [f64; 4],
    /// Factor on the texture of each column.
    pub(super) column_gains: [f64; 4],
    /// Factor on the level after slipping.
    pub(super) slip_ratio: f64,
    /// Factor on the time constants of slipping.
    pub(super) slip_slowness: f64,
    /// Relative level of each column of the contact.
    pub(super) column_levels: [f64; 4],
    /// Ridges across the stroke, if there are any.
    pub(super) ridges: Option<Ridges>,
    /// Standard deviation of the force that is common to all taxels, relative to the level.
    pub(super) force: f64,
    /// Variation of the texture's strength, if it is not steady.
    pub(super) envelope: Option<SurfaceEnvelope>,
}

/// Variation of the strength of a surface's texture.
#[derive(Debug, Clone, Copy)]
pub(super) struct SurfaceEnvelope {
    /// Standard deviation of the logarithm of the strength.
    pub(super) depth: f64,
    /// Correlation time at 3 cm/s, steps.
    pub(super) steps: f64,
}

/// Index of the mixed coordinate of the fine bands, which also sets the unsteadiness of a texture.
const FINE: usize = 2;

/// Weak periodic part of a surface with a pitch.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ridges {
    /// Distance between two ridges, mm.
    pub(super) pitch_mm: f64,
    /// Amplitude, relative to the level.
    pub(super) amplitude: f64,
}

/// Returns the coordinates of a latent point, mixed by an orthonormal matrix (the type-II cosine transform). Every axis
/// affects every parameter, and distances are preserved.
fn mixture(latent: &Latent) -> [f64; DIMENSIONS] {
    std::array::from_fn(|k| {
        let norm = (if k == 0 { 1.0 } else { 2.0 } / DIMENSIONS as f64).sqrt();
        latent
            .iter()
            .enumerate()
            .map(|(axis, z)| {
                let angle =
                    std::f64::consts::PI * (axis as f64 + 0.5) * k as f64 / DIMENSIONS as f64;
                norm * angle.cos() * z
            })
            .sum()
    })
}

/// Returns the surface at `latent`; `label` decides only on ridges.
pub(super) fn surface(label: usize, latent: &Latent, construction: &Construction) -> Surface {
    let c = construction;
    let mixed = match c.bound {
        None => mixture(latent),
        Some(bound) => mixture(latent).map(|x| bound * (x / bound).tanh()),
    };
    let [undulation, coarse, fine, length, rows, columns]: Latent =
        std::array::from_fn(|k| c.gains[k] * mixed[k]);
    let medium = if c.grain_follows {
        (coarse + fine) / 2.0
    } else {
        fine
    };
    let factor = [undulation, coarse, medium, fine].map(f64::exp);
    let grain = if c.grain_follows { factor[3] } else { 1.0 };
    Surface {
        amplitudes: std::array::from_fn(|band| c.amplitudes[band] * factor[band]),
        correlation_steps: std::array::from_fn(|band| match band {
            0 => c.correlation_steps[0],
            _ => c.correlation_steps[band] * length.exp(),
        }),
        grain_variance: (c.grain * c.grain) * grain * grain,
        row_gains: ramp(rows),
        column_gains: ramp(columns),
        slip_ratio: (c.slip_ratio * (coarse - undulation)).exp(),
        slip_slowness: (c.slip_duration * length).exp(),
        column_levels: ramp(c.column_levels * length),
        ridges: ridges(label),
        force: c.force,
        envelope: (c.envelope.depth > 0.0).then(|| SurfaceEnvelope {
            depth: c.envelope.depth * (c.envelope.gain * mixed[FINE]).exp(),
            steps: c.envelope.steps,
        }),
    }
}

/// Returns factors on four neighbours whose logarithm increases by `slope` from one to the next.
fn ramp(slope: f64) -> [f64; 4] {
    [-1.5, -0.5, 0.5, 1.5].map(|place: f64| (slope * place).exp())
}

/// The pitches are plausible values; the publication names none.
fn ridges(label: usize) -> Option<Ridges> {
    match NAMES[label] {
        "metallic grid" => Some(Ridges {
            pitch_mm: 1.0,
            amplitude: 0.03,
        }),
        "rubber rough horizontal" => Some(Ridges {
            pitch_mm: 2.0,
            amplitude: 0.04,
        }),
        "rubber rough vertical" => Some(Ridges {
            pitch_mm: 1.4,
            amplitude: 0.015,
        }),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mixing_keeps_distances() {
        for axis in 0..DIMENSIONS {
            let mut latent = [0.0; DIMENSIONS];
            latent[axis] = 1.0;
            let squares: f64 = mixture(&latent).iter().map(|x| x * x).sum();
            assert!((squares - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn names_are_distinct_and_three_materials_have_ridges() {
        assert!(crate::LabelSet::new(NAMES).is_ok());
        assert_eq!(
            (0..MATERIALS)
                .filter(|&label| ridges(label).is_some())
                .count(),
            3
        );
    }
}
