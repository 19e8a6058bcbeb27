//! scratch
use deepfusion_perception::*;
use deepfusion_sim::*;
use nalgebra::Vector3;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let frames: usize = a[1].parse().unwrap();
    let moving: usize = a[2].parse().unwrap();
    let verbose = std::env::var("V").is_ok();
    let mut scorer = Scorer::new(ScoringRules::default());
    for seed in a[3..].iter().map(|s| s.parse::<u64>().unwrap()) {
    let scene = match std::env::var("S").as_deref() { Ok("garage") => Scene::Garage, Ok("park") => Scene::Park, Ok("commercial") => Scene::Commercial, _ => Scene::Urban };
    let sim = Simulation::new(&SimConfig { seed, frames, moving_cars: moving, scene, ..SimConfig::default() }).unwrap();
    let k = sim.intrinsics();
    let mut one = Scorer::new(ScoringRules::default());
    scorer.begin_drive();
    let mut perception = Perception::new(PerceptionConfig::default());
    let mut ms = 0.0;
    for f in 0..frames {
        let fr = sim.frame(f);
        let t = std::time::Instant::now();
        let seen = perception.look(&fr.depth, &k, Some(Stamp { time_s: fr.time_s, world_from_cam: { let first = sim.world_from_cam(0); first.inverse() * fr.world_from_cam } })).unwrap();
        ms += t.elapsed().as_secs_f64() * 1e3;
        let cam_from_world = fr.world_from_cam.inverse();
        let objs: Vec<_> = sim.objects(f).into_iter().enumerate().map(|(i, o)| { let m = cam_from_world * o.world_from_object; (i, o, m, m.inverse()) }).filter(|(_, _, m, _)| { let t = m.translation(); t.z > -5.0 && t.norm() < 70.0 }).collect();
        let mut count = vec![0usize; objs.len()];
        for v in 0..k.height as usize { for u in 0..k.width as usize {
            let z = fr.depth.data[v * k.width as usize + u];
            if z <= 0.0 || z > 60.0 { continue; }
            let p = k.back_project(u as f64, v as f64, z as f64);
            for (i, (_, o, _, inv)) in objs.iter().enumerate() {
                if o.class != ObjectClass::Car { continue; }
                let q = inv.transform(&p);
                if q.x.abs() <= 0.5 * o.size[0] + 0.05 && q.y.abs() <= 0.5 * o.size[1] + 0.05 && q.z > -0.5 * o.size[2] + 0.02 && q.z <= 0.5 * o.size[2] + 0.05 { count[i] += 1; break; }
            }
        } }
        let labels: Vec<Label> = objs.iter().zip(&count).map(|((id, o, m, _), n)| {
            let ax = m.rotate(&Vector3::x());
            Label { object: *id as u64, center_m: m.translation().into(), size_m: o.size, yaw_rad: (-ax.z).atan2(ax.x), velocity_mps: Some(cam_from_world.rotate(&o.velocity).into()), counts: o.class == ObjectClass::Car && *n >= 50 }
        }).collect();
        let matched = scorer.add(fr.time_s, &seen.targets, &labels); let found = matched.found;
        one.add(fr.time_s, &seen.targets, &labels);
        if verbose && f % 10 == 0 { 
            println!("frame {f}");
            for j in &matched.false_targets { let t = &seen.targets[*j]; 
                let mut n = std::collections::BTreeMap::new();
                if let Some(b) = t.bounds { for v in b[1]..=b[3] { for u in b[0]..=b[2] { let z = fr.depth.data[(v * k.width + u) as usize]; if perception.obstacles().height[(v * k.width + u) as usize] < 0.0 { continue; } let p = k.back_project(u as f64, v as f64, z as f64);
                  let mut c = "none".to_string(); for (_, o, _, inv) in &objs { let q = inv.transform(&p); if q.x.abs() <= 0.5 * o.size[0] + 0.05 && q.y.abs() <= 0.5 * o.size[1] + 0.05 && q.z <= 0.5 * o.size[2] + 0.05 { c = format!("{:?} {:.1?}", o.class, o.size); break; } } *n.entry(c).or_insert(0) += 1; } } }
                println!("  FALSE id {} {:.1?} size {:.1?} yaw {:.1} px {} {:?} conf {:.2} {:?}", t.id, t.center_m, t.size_m, t.yaw_rad, t.pixels, t.bounds, t.confidence, n); }
            for (i, l) in labels.iter().enumerate() { if l.counts && found[i].is_none() && l.center_m.iter().map(|x| x*x).sum::<f64>() < 1600.0 { 
                let near = seen.targets.iter().min_by(|a, b| { let d = |t: &Target| (0..3).map(|k| (t.center_m[k] - l.center_m[k]).powi(2)).sum::<f64>(); d(a).total_cmp(&d(b)) });
                println!("  MISS {:.1?} size {:.1?} px {} near {:?}", l.center_m, l.size_m, count[i], near.map(|t| (t.id, t.center_m.map(|x| (x*10.0).round()/10.0), t.size_m.map(|x| (x*10.0).round()/10.0), t.pixels, (t.confidence*100.0).round()/100.0))); } 
              if let Some(j) = found[i] { if let (Some(a), Some(b)) = (l.velocity_mps, seen.targets[j].velocity_mps) { let e = (0..3).map(|k| (a[k]-b[k]).powi(2)).sum::<f64>().sqrt(); if e > 1.0 { println!("  VEL id {} at {:.1?} truth {:.1?} told {:.1?}", seen.targets[j].id, l.center_m, a, b); } } } }
        }
    }
    let s = one.score();
    println!("seed {seed}: recall {:.3} precision {:.3} centre {:.2} yaw {:.1} vel {:.2} ({}) motion {:.2} switches {} ranges {:?} ms {:.2}", s.recall.unwrap_or(0.0), s.precision.unwrap_or(0.0), s.center_error_m.unwrap_or(0.0), s.yaw_error_deg.unwrap_or(0.0), s.velocity_error_mps.unwrap_or(0.0), s.velocities, s.motion_accuracy.unwrap_or(0.0), s.identity_switches, s.ranges.iter().map(|r| (r.labels, r.found)).collect::<Vec<_>>(), ms / frames as f64);
    }
    let s = scorer.score();
    println!("ALL: labels {} recall {:.3} precision {:.3} centre {:.2} yaw {:.1} vel {:.2} ({}) motion {:.2} switches {} ranges {:?}", s.labels, s.recall.unwrap_or(0.0), s.precision.unwrap_or(0.0), s.center_error_m.unwrap_or(0.0), s.yaw_error_deg.unwrap_or(0.0), s.velocity_error_mps.unwrap_or(0.0), s.velocities, s.motion_accuracy.unwrap_or(0.0), s.identity_switches, s.ranges.iter().map(|r| (r.labels, r.found)).collect::<Vec<_>>());
}
