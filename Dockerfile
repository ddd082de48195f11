# SPDX-License-Identifier: BSD-3-Clause
# A built workspace, made by the README's commands:
#   docker build -t m2wr .                              ends with an error where the demo does not reach its goal
#   docker run --rm -p 127.0.0.1:8080:8080 m2wr         the live view; open the link that it prints
#   docker run --rm -it m2wr bash                       a shell in which devel/ is sourced
#   docker run --rm m2wr make test
FROM debian:12

RUN apt-get update && apt-get install -y --no-install-recommends ca-certificates git make

COPY . /m2wr_ws
WORKDIR /m2wr_ws
RUN make demo

RUN echo 'source /m2wr_ws/devel/setup.bash' >> /root/.bashrc
EXPOSE 8080
# the port of a container reaches only what listens at all its addresses; the link has a token
CMD ["tools/live.sh", "live_host:=0.0.0.0", "live_port:=8080"]
