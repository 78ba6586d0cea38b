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

# The book's tests, its generated page made anew, and its HTML where mdbook is installed
book:
    UPDATE_BOOK=1 cargo test -p calib-cli --test book
    mdbook build book

# Review changed snapshots
snapshots:
    cargo insta review --workspace

# Licences and sources of the dependencies
deny:
    cargo deny --offline check licenses bans sources
