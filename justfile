# Commands for development. `just --list` shows them.

# Formatting, lints and unit tests, without optional features: under three minutes once dependencies are built.
quick:
    cargo fmt --all --check
    cargo clippy --release --workspace --all-targets --locked -- -D warnings
    cargo test --release --workspace --lib --locked --quiet

# All checks that a change must pass, with all features; prints the time of each step at the end.
ci:
    .ci/run

# Benchmarks: `just bench` runs all, `just bench block` one. They compare within one run; no test asserts a time.
bench NAME='':
    {{ if NAME == '' { 'cargo bench --workspace' } else { 'cargo bench --workspace --bench ' + NAME } }}

# The book of all pages, in target/book/site; PYTHON has mkdocs-material, see docs/building.md.
book PYTHON='python3':
    cargo build --release --locked --quiet --features full
    {{PYTHON}} tests/book.py --tactnet target/release/tactnet --out target/book

# Packet definitions for other languages; run after a change of serving/skin/src/packets.rs.
packets:
    cargo build --release --locked --quiet
    tests/generated_packets.sh
