# calib in a container: docker build -t calib . && docker run --rm -v "$PWD:/work" calib run robots/ripley.yaml
FROM rust:1.90-slim-bookworm AS build
WORKDIR /calib
COPY . .
RUN cargo build --release --locked -p calib-cli

# The same C library as above, so that plugins load.
FROM debian:bookworm-slim
COPY --from=build /calib/target/release/calib /usr/local/bin/calib
# Results belong to the user who runs the container with `--user`; nobody needs to be root in it.
USER 1000:1000
WORKDIR /work
ENTRYPOINT ["calib"]
CMD ["--help"]
