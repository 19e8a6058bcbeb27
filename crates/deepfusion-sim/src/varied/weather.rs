//! The time of day and the weather of a view.

use super::draw::{log_uniform, normal, weighted};
use crate::config::Scene;
use crate::render::{Air, Fog, Glow};
use crate::scene::World;
use crate::texture::sky::Sky;
use crate::texture::{Rgb, mix};
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

/// Koschmieder: at the visibility contrast has fallen to 2 %, which is e^(−3.9).
const TWO_PERCENT: f32 = 3.9;

/// The weather of a view.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Weather {
    /// Sun in a blue or milky sky.
    Clear,
    /// Sun between clouds.
    Cloudy,
    /// No sun; the only shadows are those in the sky's light.
    Overcast,
    /// Visibility of 30 to 400 m.
    Fog,
    /// No sky: under ground or indoors.
    Indoor,
    /// Lamps and little else.
    Night,
}

impl Weather {
    /// Its name in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Clear => "clear",
            Self::Cloudy => "cloudy",
            Self::Overcast => "overcast",
            Self::Fog => "fog",
            Self::Indoor => "indoor",
            Self::Night => "night",
        }
    }
}

/// Visibility, metres; none in clear air.
pub(super) fn visibility(air: &Air) -> Option<f32> {
    air.fog.map(|fog| TWO_PERCENT / fog.extinction)
}

/// The weather of a plain world.
pub(super) fn plain(world: &World) -> Weather {
    match world.scene {
        Scene::Garage | Scene::Indoor => Weather::Indoor,
        Scene::Night => Weather::Night,
        _ => Weather::Clear,
    }
}

/// Draws the weather. By day: 42 % clear, 20 % cloudy, 33 % overcast, 5 % fog. Without fog there is haze in 65 % of the views, with a
/// visibility of 0.5 to 20 km. The ground is wet in a third of the overcast and foggy views, and in a tenth of the others. At night: 30 %
/// with fog, and wet ground in a quarter.
pub(super) fn draw(rng: &mut ChaCha8Rng, world: &World) -> (Weather, Air) {
    match world.scene {
        Scene::Garage | Scene::Indoor => (Weather::Indoor, indoor(rng, world)),
        Scene::Night => (Weather::Night, night(rng, world)),
        _ => day(rng, world),
    }
}

fn indoor(rng: &mut ChaCha8Rng, world: &World) -> Air {
    let (sun, sky) = world.light;
    let warm = normal(rng, 0.0, 0.08, 2.0) as f32;
    let tone = Rgb::new(1.0 + warm, 1.0, 1.0 - warm);
    Air {
        light: (
            sun,
            sky.component_mul(&tone) * log_uniform(rng, 0.5, 4.0) as f32,
        ),
        ..Air::of(world)
    }
}

fn night(rng: &mut ChaCha8Rng, world: &World) -> Air {
    // From late dusk to darkness.
    let dusk = log_uniform(rng, 0.5, 8.0) as f32;
    let blue = Rgb::new(0.85, 0.95, 1.15);
    let (moon, sky) = world.light;
    let mut air = Air {
        light: (moon, sky.component_mul(&blue) * dusk),
        tint: blue * dusk,
        wet: wetness(rng, 0.25),
        ..Air::of(world)
    };
    if rng.random_bool(0.3) {
        air.fog = Some(Fog {
            extinction: TWO_PERCENT / log_uniform(rng, 150.0, 3000.0) as f32,
            colour: air.sky.horizon.component_mul(&air.tint) * 1.3,
            height: 300.0,
        });
    }
    air
}

fn day(rng: &mut ChaCha8Rng, world: &World) -> (Weather, Air) {
    let weather = weighted(
        rng,
        &[
            (0.42, Weather::Clear),
            (0.2, Weather::Cloudy),
            (0.33, Weather::Overcast),
            (0.05, Weather::Fog),
        ],
    );
    let sun = sunlight(world.sun.z) * rng.random_range(1.7..2.7);
    // A low sun leaves less light in the sky and warms the sky's lower part.
    let day = (0.25 + 1.5 * world.sun.z.max(0.0)).min(1.0);
    let low = (1.0 - world.sun.z / 0.3).clamp(0.0, 1.0);
    let milky: f32 = rng.random();
    let blue = mix(
        &Rgb::new(0.14, 0.32, 0.74),
        &Rgb::new(0.45, 0.56, 0.74),
        milky,
    );
    let pale = mix(
        &Rgb::new(0.72, 0.8, 0.88),
        &Rgb::new(0.98, 0.72, 0.5),
        0.8 * low,
    );
    let grey = mix(
        &Rgb::new(0.8, 0.84, 0.9),
        &Rgb::new(0.92, 0.92, 0.9),
        rng.random(),
    );
    let mut air = match weather {
        Weather::Overcast | Weather::Fog => {
            let level = rng.random_range(0.5..1.3f32) * day;
            // Between houses the ground sees only a part of the sky, so the sky is brighter than the light on the ground suggests.
            let bright = rng.random_range(1.2..2.6);
            // Some sunlight passes a thin cover.
            let through = if rng.random_bool(0.3) {
                rng.random_range(0.02..0.2f32)
            } else {
                0.0
            };
            Air {
                sky: Sky {
                    horizon: grey * rng.random_range(0.8..1.0),
                    zenith: grey * rng.random_range(0.7..1.2),
                    clouds: rng.random_range(-1.0..1.0),
                },
                tint: Rgb::new(1.0, 1.0, 1.0) * (level * bright),
                glow: None,
                light: (sun * through, grey * level),
                fog: None,
                wet: wetness(rng, 0.33),
            }
        }
        _ => {
            let clouds: f32 = match weather {
                Weather::Clear => rng.random_range(-0.3..0.25),
                _ => rng.random_range(0.25..0.75),
            };
            let ambient = mix(&blue, &grey, 0.45 + 0.4 * clouds.max(0.0));
            Air {
                sky: Sky {
                    horizon: pale * rng.random_range(0.75..1.1),
                    zenith: blue,
                    clouds,
                },
                tint: mix(
                    &Rgb::new(1.0, 1.0, 1.0),
                    &Rgb::new(1.0, 0.85, 0.72),
                    0.6 * low,
                ) * day,
                glow: Some(Glow {
                    sun: world.sun,
                    strength: sun * 6.0,
                }),
                light: (
                    sun * (1.0 - 0.35 * clouds.max(0.0)),
                    ambient * (day * rng.random_range(0.3..0.9)),
                ),
                fog: None,
                wet: wetness(rng, 0.1),
            }
        }
    };
    let visibility = match weather {
        Weather::Fog => Some(log_uniform(rng, 30.0, 400.0)),
        _ => rng
            .random_bool(0.65)
            .then(|| log_uniform(rng, 500.0, 20_000.0)),
    };
    air.fog = visibility.map(|metres| Fog {
        extinction: TWO_PERCENT / metres as f32,
        colour: mix(&air.sky.horizon, &grey, 0.5).component_mul(&air.tint),
        height: if weather == Weather::Fog { 60.0 } else { 400.0 },
    });
    (weather, air)
}

fn wetness(rng: &mut ChaCha8Rng, chance: f64) -> f32 {
    if rng.random_bool(chance) {
        rng.random_range(0.3..1.0)
    } else {
        0.0
    }
}

/// The sun's colour after its path through the air, by the sine of its elevation: about 1 overhead, dim and red when low.
fn sunlight(sine: f32) -> Rgb {
    // Air mass, and optical depths of red, green and blue in moderately hazy air.
    let mass = 1.0 / (sine.max(0.0) + 0.06);
    Rgb::new(0.05, 0.10, 0.19)
        .map(|depth| (-depth * mass).exp())
        .component_mul(&Rgb::new(1.05, 1.05, 1.05))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_low_sun_is_dim_and_red() {
        let (high, low) = (sunlight(0.9), sunlight(0.08));
        assert!(low.x < high.x && low.z / low.x < 0.6 * high.z / high.x);
        assert!(high.min() > 0.7 && low.min() > 0.0);
    }
}
