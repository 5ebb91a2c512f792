# gprop with ONNX Runtime and SAM, which runs without a network (a server that answers questions apart):
#
#     docker build --tag gprop .
#     docker run --volume "$PWD:/data" gprop run /data/my_scene
#
# Results belong to user 1000; `--user "$(id -u):$(id -g)"` makes them yours.
FROM rust:1.95-slim-bookworm AS build
RUN apt-get update && apt-get install --yes --no-install-recommends python3-pip
COPY . /gprop
RUN pip wheel --no-deps --wheel-dir /wheels /gprop

FROM debian:bookworm-slim
RUN apt-get update && apt-get install --yes --no-install-recommends ca-certificates python3 python3-venv
COPY --from=build /wheels /gprop/scripts/install-in-image /tmp/gprop/
RUN /tmp/gprop/install-in-image /tmp/gprop/gprop-*.whl && rm -r /tmp/gprop
ENV XDG_CACHE_HOME=/opt/gprop/cache
USER gprop
WORKDIR /data
ENTRYPOINT ["gprop"]
