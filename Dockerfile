# docker build -t identikal . && docker run --rm -v "$PWD:/data" identikal tune model.yaml log.csv
FROM debian:bookworm-slim AS build
WORKDIR /identikal
COPY prepare.sh packages.txt ./
RUN ./prepare.sh $(cat packages.txt)
COPY . .
RUN ./run.sh && cpack --config build/CPackConfig.cmake

FROM debian:bookworm-slim
COPY --from=build /identikal/identikal_*.deb /tmp/
RUN apt-get update && apt-get install -y --no-install-recommends /tmp/identikal_*.deb && rm -rf /var/lib/apt/lists/* /tmp/*.deb
WORKDIR /data
ENTRYPOINT ["identikal"]
CMD ["--help"]
