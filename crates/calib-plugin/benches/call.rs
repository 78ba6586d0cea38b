//! What a call costs when the estimator does nothing: built in, and across the border.
//!
//! `cargo bench -p calib-plugin`; the limit is 1 µs between the two. For both, every sample is read once before the
//! call, to promise finite numbers.

use std::{collections::BTreeMap, hint::black_box};

use calib_plugin::{
    Answer, Call, Control, Cor, CorFit, Entry, Failure, Host, Kind, Motion, MotionData, Offer,
    Parameter, Shape,
};
use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};

struct Nothing;
impl Cor for Nothing {
    fn offer(&self) -> Offer {
        Offer::new(Kind::Cor, "nothing", "")
            .takes(&[Shape::Points])
            .with(Parameter::number("gain", 1.0, ""))
    }
    fn fit(&self, motion: &Motion<'_>, _: &Call<'_>) -> Result<Answer<CorFit>, Failure> {
        Ok(Answer::Found(CorFit {
            center_m: motion.points_m[0],
            covariance_m2: None,
            body_points_m: Vec::new(),
            radii_m: Vec::new(),
            rms_m: 0.0,
            used: 1,
            rejected: Vec::new(),
            weak: None,
        }))
    }
}

calib_plugin::entry! {
    nothing: name: "nothing", version: "0", author: "", licence: "MIT", cor: [Nothing],
}
static ENTRY: calib_plugin::abi::Entry = nothing::ENTRY;

fn calls(criterion: &mut Criterion) {
    let plugin = Host::adopt(&ENTRY).expect("the plugin of this file");
    let parameters = BTreeMap::new();
    let loaded = plugin
        .cor("nothing")
        .and_then(|entry| entry.with(&parameters))
        .expect("the estimator of this file");
    let built_in = Entry::built_in_cor(Nothing)
        .with(&parameters)
        .expect("no parameters needed");
    let control = Control::default();
    let mut group = criterion.benchmark_group("call");
    for samples in [10, 1000, 100_000] {
        let track = (0..samples)
            .map(|i| Some([f64::from(i), 0.0, 0.0]))
            .collect();
        let data = MotionData::points(&[track]);
        for (name, bound) in [("built_in", &built_in), ("plugin", &loaded)] {
            group.bench_function(BenchmarkId::new(name, samples), |bencher| {
                bencher.iter(|| bound.fit(black_box(&data.view()), &control));
            });
        }
    }
    group.finish();
}

criterion_group!(benches, calls);
criterion_main!(benches);
