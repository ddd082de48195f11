# SPDX-License-Identifier: BSD-3-Clause
# A built workspace, made by the README's commands:
#   docker build -t m2wr .             ends with an error where the demo does not reach its goal
#   docker run --rm -it m2wr           a shell in which devel/ is sourced
#   docker run --rm m2wr make test
FROM debian:12

RUN apt-get update && apt-get install -y --no-install-recommends ca-certificates git make

COPY . /m2wr_ws
WORKDIR /m2wr_ws
RUN make demo

RUN echo 'source /m2wr_ws/devel/setup.bash' >> /root/.bashrc
CMD ["bash"]
