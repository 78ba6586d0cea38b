use calib_pipeline::*;
use std::path::Path;
fn main() {
    let path = std::env::args().nth(1).unwrap();
    let t0 = std::time::Instant::now();
    let robot = load::load_robot(Path::new(&path)).unwrap();
    let inputs = load::load_recordings(robot).unwrap();
    let mut findings = inputs.findings.clone();
    let tracks = tracks::body_tracks(&inputs, &mut findings).unwrap();
    let start = start::start(&inputs, &tracks);
    println!("load+start {:?}", t0.elapsed());
    for f in [ml::Freedom::RegistrationOnly, ml::Freedom::Profile] {
        let t0 = std::time::Instant::now();
        let stated = ml::state(&inputs, &tracks, &start, f);
        let fit = ml::fit(stated, &inputs, true).unwrap();
        let s = &fit.solution;
        println!(
            "{f:?} {:?} it {} chi2/dof {:.3} stated {:.3} rejected {} nullity {} time {:?}",
            s.status,
            s.iterations,
            s.chi2 / s.degrees_of_freedom,
            s.chi2_stated / s.degrees_of_freedom,
            s.rejected.len(),
            s.observability.nullity(),
            t0.elapsed()
        );
        for n in &s.noise {
            println!(
                "  noise {} stated {:.5} sigma {:.6}",
                n.name, n.stated, n.sigma
            );
        }
        if let Some(h) = s.held_out() {
            let e = calib_core_summary(&h.samples);
            println!("  held-out {e:?}");
        }
        if f == ml::Freedom::Profile {
            for d in &s.observability.null {
                println!("  null {} | {}", d.text, d.remedy);
            }
            let truth: serde_json::Value =
                std::fs::read_to_string(Path::new(&path).with_extension("").join("truth.json"))
                    .map(|t| serde_json::from_str(&t).unwrap())
                    .unwrap_or_default();
            for (name, o) in &inputs.robot.profile.origins {
                let m = &inputs.robot.model;
                let body = fit.stated.bodies[&o.body];
                let link = fit.stated.links[o.link.index()].unwrap();
                let p = s
                    .relative_pose(body, link, &calib_core::Configuration::zero())
                    .unwrap();
                let _ = m;
                report(&truth, &format!("{}_from_{name}", o.body), &p);
            }
            for (name, t) in &inputs.robot.profile.transforms {
                let p = s
                    .relative_pose(
                        fit.stated.links[t.parent.index()].unwrap(),
                        fit.stated.links[t.child.index()].unwrap(),
                        &calib_core::Configuration::zero(),
                    )
                    .unwrap();
                report(&truth, name, &p);
            }
            for p in &s.parameters {
                println!(
                    "    {:32} {:+.6} sigma {:?} share {:.3} {:?}",
                    p.name,
                    p.value - p.nominal,
                    p.sigma,
                    p.data_share,
                    p.class
                );
            }
        }
    }
}
fn calib_core_summary(s: &[calib_core::SamplePrediction]) -> calib_core::ErrorSummary {
    calib_core::ErrorSummary::positions(s)
}
fn report(truth: &serde_json::Value, name: &str, p: &calib_core::DerivedPose) {
    let t = &truth["transforms"][name];
    if t.is_null() {
        return;
    }
    let v: Vec<f64> = t["translation_m"]
        .as_array()
        .unwrap()
        .iter()
        .map(|x| x.as_f64().unwrap())
        .collect();
    let q: Vec<f64> = t["rotation_xyzw"]
        .as_array()
        .unwrap()
        .iter()
        .map(|x| x.as_f64().unwrap())
        .collect();
    let t = nalgebra::Isometry3::from_parts(
        nalgebra::Vector3::from_row_slice(&v).into(),
        nalgebra::UnitQuaternion::new_normalize(nalgebra::Quaternion::new(q[3], q[0], q[1], q[2])),
    );
    let e = calib_geometry::se3::log(&(p.pose.inverse() * t));
    let z2 = p.covariance.map(|c| {
        (e.0.transpose()
            * nalgebra::Cholesky::new(c)
                .map(|c| c.inverse())
                .unwrap_or_else(nalgebra::Matrix6::zeros)
            * e.0)[(0, 0)]
    });
    println!(
        "  {name}: err {:.3} mm {:.4} deg  z2 {:?} (99% 16.8) estimable {}",
        e.linear().norm() * 1e3,
        e.angular().norm().to_degrees(),
        z2,
        p.estimable
    );
}
