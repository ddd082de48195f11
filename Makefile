# Every target is one script in tools/; `make help` lists them. Variables given on the command line reach the scripts.
.DEFAULT_GOAL := help
.PHONY: help setup build demo demo-mapping gallery reference docs test fuzz soak faults lint clean
.NOTPARALLEL:

export DEMO_ARGS LIVE GALLERY TEST_JOBS TEST_TIMEOUT TEST_PACKAGES MINUTES FUZZ_ARGS HOURS SOAK_ARGS MOMENTS PAIRS

help:  ## list the targets and the variables they take
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/  make \1\t\2/p' Makefile | expand -t 16
	@echo
	@echo "Variables: DEMO_ARGS='--seed 3'  options of the demo (rosrun m2wr_sim demo -h)"
	@echo "           LIVE=1  the demo in a browser, at real-time factor 1; the recorded run stays there until Ctrl-C"
	@echo "           GALLERY='docs/5_bug2.md'  only the pictures of these documents"
	@echo "           TEST_PACKAGES='m2wr_sim'  test only these packages;  TEST_JOBS=2  tests run concurrently"
	@echo "           MOMENTS=100  interrupts of each launch file in make faults;  PAIRS=10  runs repeated under load"
	@echo "           TEST_TIMEOUT=3900  seconds after which a test run is ended and counts as failed"
	@echo "           MINUTES=60  how long fuzz runs;  FUZZ_ARGS='--target urdf'  its options (test/fuzz/README.md)"
	@echo "           HOURS=24  simulated hours of soak;  SOAK_ARGS='--factor 20'  its options (docs/endurance.md)"

setup:  ## system packages, workspace venv and build: needed by the other targets
	@tools/setup.sh

build:  ## build every package with catkin-tools into devel/
	@tools/build.sh

demo: setup  ## drive the robot to its goal without a window; ends by itself, exit 0 if the goal was reached
	@tools/demo.sh

demo-mapping: setup  ## map the world during a tour; print how well the map agrees with the world, and draw it
	@tools/demo_mapping.sh

gallery: setup  ## make the pictures of README and docs/ again, by the commands beside them; no display needed
	@tools/gallery.sh

reference: setup  ## write docs/reference.md again: packages, programs, topics, services, parameters, launch arguments
	@tools/reference.sh

docs: setup  ## write the API reference to api_docs/ from the docstrings; a warning of Sphinx is an error
	@tools/docs.sh

test: setup  ## run every test of every package and print one summary; JUnit XML in test_results/
	@tools/test.sh

fuzz: setup  ## invalid input to readers, services, topics and sockets, for MINUTES; findings can be repeated
	@tools/fuzz.sh

soak: setup  ## simulated HOURS of mapping, spawning, resetting and service calls; growth of memory as a figure
	@tools/soak.sh

faults: setup  ## every fault of test/faults, interrupts of every launch file, repeatability under load; hours
	@tools/faults.sh

lint: setup  ## catkin_lint, flake8, ruff, mypy, licences, XML, shell, structure; a warning is an error
	@tools/lint.sh

clean:  ## remove the files made by set-up, build, demo and test (catkin_build devel install logs .venv ...)
	@tools/clean.sh
