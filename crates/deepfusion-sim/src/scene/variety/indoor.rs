//! Rooms in a row, joined by doors, each with its own walls, floor, ceiling, light and furniture.

use super::site::{Site, Spot};
use crate::road::Road;
use crate::scene::{ObjectClass, Room};
use crate::texture::ground::Stretch;
use crate::texture::ground_style::{GroundStyle, Kind as Floor, Surface};
use crate::texture::pattern::{Kind, Pattern, wall_colour};
use crate::texture::{Material, Rgb};
use rand::Rng;
use std::f64::consts::{FRAC_PI_2, PI};

/// Position of the doors, metres left of the centreline: a straight path leads through all rooms.
const WAY: f64 = -1.65;
/// Half the width of that path, which furniture leaves free, metres.
pub(super) const FREE: f64 = 0.62;

/// Height of the walls between rooms, above the highest ceiling, metres.
const TALL: f64 = 5.4;

/// Furnishes a row of rooms along a straight line, which takes the place of the road.
pub(super) fn furnish(site: &mut Site) {
    let (start, end) = (site.world.road.start, site.world.road.end());
    site.world.road = Road::straight(start, end);
    site.world.road.kerb = 0.0;
    let count = site.world.road.samples_mut().len();
    for sample in site.world.road.samples_mut() {
        sample.half_width = 60.0;
    }
    site.world.road.index();
    site.world.stretch_of = vec![0; count];
    let level = site.rng.random_range(0.12..0.5f32);
    let warm = site.rng.random_range(-0.1..0.25f32);
    site.world.light = (Rgb::zeros(), Rgb::new(1.0 + warm, 1.0, 1.0 - warm) * level);
    let mut x = start + 1.0;
    while x + 12.0 < end {
        let length = if site.chance(0.15) {
            site.draw(6.0, 12.0)
        } else {
            site.draw(2.8, 7.5)
        };
        let narrow = site.chance(0.15);
        let (right, left) = if narrow {
            (site.draw(0.9, 1.3), site.draw(0.9, 1.5))
        } else {
            (site.draw(1.0, 4.5), site.draw(1.0, 4.5))
        };
        let room = Room {
            low: [x, WAY - right],
            high: [x + length, WAY + left],
            height: if site.chance(0.15) {
                site.draw(3.0, 5.0)
            } else {
                site.draw(2.25, 3.0)
            },
        };
        build(site, &room);
        site.world.rooms.push(room);
        x += length + 0.12;
    }
    // Outer walls at both ends of the row.
    let wall = wall_material(site);
    for x in [start + 0.94, x - 0.06] {
        let spot = Spot {
            x,
            y: WAY,
            z: 0.0,
            heading: FRAC_PI_2,
        };
        site.block(&spot, [12.0, 0.1, TALL], wall);
    }
}

fn floor(site: &mut Site) -> Surface {
    match site.rng.random_range(0..10) {
        0..=2 => {
            // Parquet.
            let tone = site.rng.random_range(0.08..0.45f32);
            let brown = Rgb::new(tone, tone * 0.66, tone * 0.4);
            Surface {
                kind: Floor::Laid,
                colour: brown,
                other: brown * 0.35,
                tile: [
                    site.rng.random_range(0.4..1.6),
                    site.rng.random_range(0.06..0.2),
                ],
                grain: [0.3, 0.25],
                stain: 0.1,
            }
        }
        3..=5 => site.laid(),
        _ => {
            // Carpet, lino, concrete.
            let colour = wall_colour(site.rng);
            Surface {
                kind: Floor::Asphalt,
                colour,
                other: colour,
                tile: [1.0; 2],
                grain: [
                    site.rng.random_range(0.02..0.8),
                    site.rng.random_range(0.0..0.4),
                ],
                stain: site.rng.random_range(0.0..0.2),
            }
        }
    }
}

fn lay(site: &mut Site, room: &Room) {
    let road = floor(site);
    let style = GroundStyle {
        road,
        pavement: [road; 2],
        beyond: [road; 2],
        verge: road,
        kerb: road.colour,
        lines: [None; 6],
        paint: road.colour,
        wear: 1.0,
        crossing: 0.0,
        mended: 0.0,
        cracks: 0.0,
        leaves: [0.0; 2],
        second: [0.0; 2],
        indoors: true,
    };
    let number = site.world.stretches.len() as u16;
    site.world.stretches.push(Stretch::styled(style));
    let road = &site.world.road;
    let (from, to) = (road.index_at(room.low[0]), road.index_at(room.high[0]));
    site.world.stretch_of[from..=to].fill(number);
}

/// A random wall: paint, paper, tiles, brick or wood.
fn wall_material(site: &mut Site) -> u32 {
    let colour = wall_colour(site.rng);
    let mut pattern = Pattern::plain(site.rng, colour);
    pattern.dirt = 0.1;
    pattern.blotch[1] *= 0.3;
    pattern.grain[1] *= 0.4;
    match site.rng.random_range(0..12) {
        0 => {
            pattern.kind = Kind::Courses(site.rng.random_range(1.0..3.0), 0.08);
            pattern.scale = site.rng.random_range(0.08..0.3);
            pattern.colours[1] = colour * site.rng.random_range(0.4..1.3);
        }
        1 => {
            pattern.kind = Kind::Boards;
            pattern.scale = site.rng.random_range(0.08..0.4);
            pattern.colours[1] = colour * 0.3;
        }
        2 => {
            pattern.kind = Kind::Stripes(0.5);
            pattern.scale = site.rng.random_range(0.04..0.3);
            pattern.colours[1] = colour * site.rng.random_range(0.6..1.3);
        }
        3 => pattern = Pattern::wall(site.rng),
        4 => {
            pattern = Pattern::wild(site.rng);
            pattern.scale = pattern.scale.clamp(0.05, 0.8);
        }
        _ => {}
    }
    if site.chance(0.15) {
        pattern.posters = site.rng.random_range(0.1..0.7);
    }
    site.world.material(Material::Pattern(Box::new(pattern)))
}

fn build(site: &mut Site, room: &Room) {
    lay(site, room);
    let ([x0, y0], [x1, y1], h) = (room.low, room.high, room.height);
    let at = |x: f64, y: f64, heading: f64| Spot {
        x,
        y,
        z: 0.0,
        heading,
    };
    let wall = wall_material(site);
    let other = if site.chance(0.3) {
        wall_material(site)
    } else {
        wall
    };
    let mark = site.mark();
    let (middle, length, width) = (0.5 * (x0 + x1), x1 - x0, y1 - y0);
    site.block(
        &at(middle, y0 - 0.06, 0.0),
        [length + 0.3, 0.12, h + 0.1],
        wall,
    );
    site.block(
        &at(middle, y1 + 0.06, 0.0),
        [length + 0.3, 0.12, h + 0.1],
        other,
    );
    // The wall to the next room, with a door.
    let half = if site.chance(0.2) {
        site.draw(0.8, 1.4)
    } else {
        site.draw(0.55, 0.75)
    };
    let head = site.draw(2.0, 2.3).min(h);
    let x = x1 + 0.06;
    let (right, left) = (WAY - half - y0 + 0.8, y1 + 0.8 - WAY - half);
    site.block(
        &at(x, WAY - half - 0.5 * right, FRAC_PI_2),
        [right, 0.12, TALL],
        other,
    );
    site.block(
        &at(x, WAY + half + 0.5 * left, FRAC_PI_2),
        [left, 0.12, TALL],
        wall,
    );
    let lintel = Spot {
        z: head,
        ..at(x, WAY, FRAC_PI_2)
    };
    site.block(&lintel, [2.0 * half, 0.12, TALL - head], wall);
    let white = wall_colour(site.rng);
    let pattern = Pattern::plain(site.rng, white);
    let ceiling = if site.chance(0.6) {
        let pale = site.rng.random_range(0.5..0.85f32);
        let pattern = Pattern {
            colours: [Rgb::new(pale, pale, pale * 0.97); 2],
            ..pattern
        };
        site.world.material(Material::Pattern(Box::new(pattern)))
    } else {
        wall_material(site)
    };
    let top = Spot {
        z: h,
        ..at(middle, 0.5 * (y0 + y1), 0.0)
    };
    site.block(&top, [length + 0.3, width + 0.3, 0.2], ceiling);
    site.close(ObjectClass::Building, &top, mark);
    light(site, room);
    // Along the walls: x runs along the wall, y into the room.
    let depth = [WAY - FREE - y0, y1 - WAY - FREE];
    site.along(&at(x0, y0, 0.0), length, depth[0].min(1.1), h);
    site.along(&at(x1, y1, PI), length, depth[1].min(1.1), h);
    // Walls with doors, furnished on both sides of the door; x runs along the wall, seen from the room.
    let ends = [
        (at(x1, y0, FRAC_PI_2), WAY - FREE - 0.2 - y0),
        (at(x0, y1, -FRAC_PI_2), y1 - WAY - FREE - 0.2),
    ];
    for (origin, long) in &ends {
        if *long > 1.2 {
            // The corners are occupied already.
            let inner = origin.spot(0.75, 0.0, 0.0, 0.0);
            site.along(&inner, long - 0.75, 0.7, h);
        }
    }
    // In the open: tables, small objects, people.
    for (low, high) in [(y0 + 1.1, WAY - FREE), (WAY + FREE, y1 - 1.1)] {
        if high - low < 0.7 {
            continue;
        }
        let mut x = x0 + 0.9;
        while x < x1 - 0.9 {
            let y = 0.5 * (low + high);
            let spot = at(x, y, [0.0, FRAC_PI_2][site.rng.random_range(0..2)]);
            let room = high - low;
            site.island(&spot, room.min(2.0), h);
            x += site.draw(1.2, 3.2);
        }
    }
}

/// Lamps under the ceiling.
fn light(site: &mut Site, room: &Room) {
    let strength = site.rng.random_range(0.6..4.0f32);
    let warm = site.rng.random_range(-0.12..0.3f32);
    let colour = Rgb::new(1.0 + 0.5 * warm, 1.0, 1.0 - warm) * strength;
    let count = site.rng.random_range(1..3);
    let kit = site.kit;
    for i in 0..count {
        let part = (f64::from(i) + 0.5) / f64::from(count);
        let x = room.low[0] + part * (room.high[0] - room.low[0]);
        let y = 0.5 * (room.low[1] + room.high[1]) + site.draw(-0.3, 0.3);
        let spot = Spot {
            x,
            y,
            z: room.height - 0.1,
            heading: [0.0, FRAC_PI_2][site.rng.random_range(0..2)],
        };
        // Lamps hang above everyone's head.
        let longest = room.height - 2.4;
        match site.rng.random_range(0..3) {
            0 => site.block(&spot, [1.2, 0.15, 0.08], kit.pale),
            2 if longest > 0.1 => {
                let drop = site.draw(0.3, 0.9).min(longest);
                let ball = spot.spot(0.0, 0.0, -drop, 0.0);
                site.rod(
                    spot.at(0.0, 0.0, 0.0),
                    ball.at(0.0, 0.0, 0.0),
                    0.008,
                    kit.dark,
                );
                let shade = site.any(&kit.cloth);
                site.ball(&ball, [0.2, 0.2, 0.14], shade);
            }
            _ => site.block(&spot, [0.6, 0.6, 0.05], kit.pale),
        }
        let place = spot.at(0.0, 0.0, -0.35);
        site.world.lamps.add(x as f32, place, colour);
    }
}
