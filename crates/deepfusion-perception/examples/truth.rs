//! scratch
use deepfusion_perception::*;
use deepfusion_sim::*;
use nalgebra::Vector3;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let seed: u64 = a[1].parse().unwrap();
    let frames: usize = a[2].parse().unwrap();
    let moving: usize = a[3].parse().unwrap();
    let every: usize = a.get(4).map_or(5, |s| s.parse().unwrap());
    let verbose = std::env::var("V").is_ok();
    let sim = Simulation::new(&SimConfig { seed, frames, moving_cars: moving, ..SimConfig::default() }).unwrap();
    let k = sim.intrinsics();
    let rays = Rays::of(&k);
    let config = PerceptionConfig::default();
    let (mut tp, mut fnn, mut fp, mut dt) = (0, 0, 0, 0.0);
    let (mut ce, mut ye) = (vec![], vec![]);
    let mut bins = [[0; 2]; 4];
    for f in (0..frames).step_by(every) {
        let fr = sim.frame(f);
        let t = std::time::Instant::now();
        let g = Ground::find(&fr.depth.data, &rays, None, &config); let Some(g) = g else { println!("NO GROUND frame {f}"); let mut im = image::GrayImage::new(k.width, k.height); for (i, z) in fr.depth.data.iter().enumerate() { im.as_mut()[i] = (z * 4.0).min(255.0) as u8; } im.save("/tmp/noground.png").unwrap(); fr.rgb.save("/tmp/noground_rgb.png").unwrap(); continue };
        let t1 = t.elapsed();
        let mut ob = Obstacles::default();
        ob.find(&fr.depth.data, &rays, &g, &config);
        let t2 = t.elapsed();
        let det = detect(&fr.depth.data, &ob, &rays, &g, &config);
        let el = t.elapsed();
        dt += el.as_secs_f64();
        let cam_from_world = fr.world_from_cam.inverse();
        // truth
        let objs: Vec<_> = sim.objects(f).into_iter().map(|o| { let m = cam_from_world * o.world_from_object; (o, m, m.inverse()) }).filter(|(_, m, _)| { let t = m.translation(); t.z > -5.0 && t.norm() < 70.0 }).collect();
        let mut count = vec![0usize; objs.len()];
        for v in 0..k.height as usize { for u in 0..k.width as usize {
            let z = fr.depth.data[v * k.width as usize + u];
            if z <= 0.0 || z > 60.0 { continue; }
            let p = k.back_project(u as f64, v as f64, z as f64);
            for (i, (o, _, inv)) in objs.iter().enumerate() {
                if o.class != ObjectClass::Car { continue; }
                let q = inv.transform(&p);
                if q.x.abs() <= 0.5 * o.size[0] + 0.05 && q.y.abs() <= 0.5 * o.size[1] + 0.05 && q.z > -0.5 * o.size[2] + 0.02 && q.z <= 0.5 * o.size[2] + 0.05 { count[i] += 1; break; }
            }
        } }
        println!("g {:.3}", g.camera_height_m as f64 - fr.world_from_cam.translation().z); if verbose { println!("frame {f}: ground h {:.3} up {:?} support {:.2} true cam height {:.3}; {:?} {:?} {:?}", g.camera_height_m, g.up, g.support, fr.world_from_cam.translation().z, t1, t2-t1, el-t2); }
        let centres: Vec<_> = det.iter().map(|d| { let h = 0.5 * (d.place.heights[0] + d.place.heights[1]); let c = g.place([d.place.middle[0], d.place.middle[1], h]); Vector3::new(c[0] as f64, c[1] as f64, c[2] as f64) }).collect();
        let mut pairs = vec![];
        for (i, (o, m, _)) in objs.iter().enumerate() { if o.class != ObjectClass::Car { continue; }
            for (j, c) in centres.iter().enumerate() { let d = (c - m.translation()).norm(); if d <= 1.0 { pairs.push((d, i, j)); } } }
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut used_o = vec![None; objs.len()]; let mut used_d = vec![None; det.len()];
        for (d, i, j) in pairs { if used_o[i].is_none() && used_d[j].is_none() { used_o[i] = Some((j, d)); used_d[j] = Some(i); } }
        for (i, (o, m, _)) in objs.iter().enumerate() {
            if o.class != ObjectClass::Car || count[i] < 50 || m.translation().norm() > 40.0 { continue; }
            let b = (m.translation().norm() / 10.0) as usize;
            bins[b.min(3)][usize::from(used_o[i].is_some())] += 1;
            if let Some((j, d)) = used_o[i] {
                tp += 1; ce.push(d);
                // object's x axis in ground axes
                let ax = m.rotate(&Vector3::new(1.0, 0.0, 0.0));
                let r = ax.x * g.right[0] as f64 + ax.y * g.right[1] as f64 + ax.z * g.right[2] as f64;
                let fw = ax.x * g.forward[0] as f64 + ax.y * g.forward[1] as f64 + ax.z * g.forward[2] as f64;
                let mut dy = (det[j].place.angle as f64 - fw.atan2(r)).rem_euclid(std::f64::consts::PI); if dy > std::f64::consts::FRAC_PI_2 { dy = std::f64::consts::PI - dy; }
                ye.push(dy.to_degrees());
                if verbose && dy > 0.3 { println!("   YAW {:.0} deg: truth {:?} {:.1?} px {} det {:?}", dy.to_degrees(), m.translation().as_slice(), o.size, count[i], det[j].place); }
            } else {
                fnn += 1;
                if verbose { 
                    let t = m.translation();
                    let near = (0..det.len()).min_by(|a, b| (centres[*a] - t).norm().total_cmp(&(centres[*b] - t).norm()));
                    println!("   MISS at [{:.1} {:.1} {:.1}] size {:.1?} px {} nearest {:?}", t.x, t.y, t.z, o.size, count[i], near.map(|j| ((centres[j] - t).norm(), det[j].clone()))); }
            }
        }
        for (j, d) in det.iter().enumerate() {
            if let Some(i) = used_d[j] { let _ = i; continue; }
            if centres[j].norm() > 40.0 { continue; }
            // ignored: overlaps a non-car object or an uncounted car
            let ign = objs.iter().enumerate().any(|(i, (o, _, inv))| {
                let q = inv.transform(&centres[j]);
                let m = if o.class == ObjectClass::Car { if count[i] >= 50 && objs[i].1.translation().norm() < 40.0 { return false; } 1.0 } else { 1.0 };
                q.x.abs() <= 0.5 * o.size[0] + m && q.y.abs() <= 0.5 * o.size[1] + m
            });
            if ign { continue; }
            fp += 1;
            if verbose { println!("   FALSE {:?} at {:.1?}", d, centres[j].as_slice());
              let mut n = std::collections::BTreeMap::new();
              for v in d.bounds[1]..=d.bounds[3] { for u in d.bounds[0]..=d.bounds[2] { let z = fr.depth.data[(v * k.width + u) as usize]; if ob.height[(v * k.width + u) as usize] < 0.0 { continue; } let p = k.back_project(u as f64, v as f64, z as f64);
                let mut c = "none".to_string(); for (o, _, inv) in &objs { let q = inv.transform(&p); if q.x.abs() <= 0.5 * o.size[0] + 0.05 && q.y.abs() <= 0.5 * o.size[1] + 0.05 && q.z <= 0.5 * o.size[2] + 0.05 { c = format!("{:?} {:.1?}", o.class, o.size); break; } } *n.entry(c).or_insert(0) += 1; } }
              println!("        {n:?}"); }
        }
    }
    ce.sort_by(|a, b| a.total_cmp(b)); ye.sort_by(|a, b| a.total_cmp(b));
    let mean = |v: &Vec<f64>| v.iter().sum::<f64>() / v.len().max(1) as f64;
    println!("seed {seed}: tp {tp} fn {fnn} fp {fp} recall {:.3} precision {:.3} centre mean {:.3} yaw mean {:.2} median {:.2}; bins {:?}; ms {:.2}", tp as f64 / (tp + fnn) as f64, tp as f64 / (tp + fp) as f64, mean(&ce), mean(&ye), ye.get(ye.len() / 2).unwrap_or(&0.0), bins, dt * 1e3 / ((frames + every - 1) / every) as f64);
}
