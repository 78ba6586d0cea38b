# Shorthands; each is the plain command below it. `.ci/run` is what must pass before a change lands.

# Everything that must hold before a change lands
check:
    .ci/run

# All tests
test:
    cargo test --workspace

# API documentation without warnings
doc:
    RUSTDOCFLAGS=-Dwarnings cargo doc --workspace --no-deps

# Benchmarks, one thread
bench:
    RAYON_NUM_THREADS=1 cargo bench --workspace

# Ten minutes of a fuzz target (cargo-fuzz): just fuzz c3d
fuzz target:
    CALIB_FUZZ_SEEDS=$PWD/target/corpus cargo test -p calib-recording -p calib-capture fuzz_seeds
    cd fuzz && RUSTC_BOOTSTRAP=1 cargo fuzz run {{target}} ../target/corpus/{{target}} -- -max_total_time=600 -rss_limit_mb=2048 -malloc_limit_mb=1024 -timeout=20

# The book's tests, its generated page regenerated, and its HTML where mdbook is installed
book:
    UPDATE_BOOK=1 cargo test -p calib-cli --test suite book::
    mdbook build book

# The book's study pages, regenerated (a quarter of an hour of two processors)
studies:
    cargo run --release -q -p calib-cli -- study cor --trials 1500 --seed 1 --out target/studies
    cargo run --release -q -p calib-cli -- study aor --trials 1500 --seed 1 --out target/studies
    for study in justin ripley; do cargo run --release -q -p calib-cli -- study $study --trials 50 --seed 1 --out target/studies; done
    cargo run --release -q -p calib-cli -- study faults --trials 5 --seed 131 --out target/studies
    mkdir -p book/src/studies && cp target/studies/*.md target/studies/*-tables.csv book/src/studies/

# Tests of the Python package, in a virtual environment
python:
    crates/calib-python/check target/python

# The wheel, as a user's `pip install .` builds it (all dependencies once more, with other features)
wheel:
    pip wheel . --no-deps --wheel-dir dist

# Review changed snapshots
snapshots:
    cargo insta review --workspace

# In a folder of its own: Cargo keeps unpacked archives by version for each target folder, and would build an older one again.
# What would be published of the libraries (`publish = true`): each package built from its archive, against the others' archives
package:
    target=$(mktemp -d) && cargo publish --dry-run --workspace --target-dir "$target" && rm -r "$target"

# Licenses and sources of the dependencies
deny:
    cargo deny --offline check licenses bans sources
