# The only build file. `make help` lists the targets.
#
# Objects, binaries and everything that a run writes go to $(B): build/ or, for the sanitizer
# builds, build/asan and build/tsan, and build/short/ for what `make test` has of them.

B ?= build
PREFIX ?= /usr/local
CC ?= cc
CFLAGS ?= -O2 -g
SANITIZE ?=
# Warnings are errors in CI (CI=true); a newer compiler's must not keep anybody else from building.
WERROR ?= $(if $(filter true,$(CI)),-Werror)

WARNINGS = -Wall -Wextra -Wshadow -Wconversion -Wstrict-prototypes -Wmissing-prototypes -Wvla
# -fno-math-errno lets loops with sqrtf vectorise; -ffp-contract=off keeps results the same on
# machines with and without fused multiply-add.
ALL_CFLAGS = -std=c11 -D_GNU_SOURCE -I. $(WARNINGS) -fno-math-errno -ffp-contract=off \
             -fstack-protector-strong -pthread $(WERROR) $(SANITIZE) $(EXR_CFLAGS) $(CPPFLAGS) $(CFLAGS)
ALL_LDFLAGS = -pthread $(SANITIZE) $(LDFLAGS)

# deploy/install-deps.sh puts these in place; pkg-config runs once, when the first compiler does.
EXR_CFLAGS = $(eval EXR_CFLAGS := $(shell pkg-config --cflags OpenEXR))$(EXR_CFLAGS)
EXR_LIBS = -lOpenEXRCore
COMMON_LIBS = -lcjson -lm
IMAGE_LIBS = $(EXR_LIBS) -lpng -ljpeg -ltiff -lheif -lwebpdemux -lwebp -llcms2 -lz
SERVER_LIBS = -lmeshoptimizer -lcurl -lmicrohttpd -lgnutls -lsqlite3 -larchive -lseccomp -lexpat -lunistring $(EMBREE_LIB) $(IMAGE_LIBS) $(COMMON_LIBS)
CLIENT_LIBS = -lcurl -larchive $(COMMON_LIBS)
EMBREE_LIB = $(if $(wildcard /usr/include/embree4/rtcore.h /usr/local/include/embree4/rtcore.h),-lembree4,-lembree3)

COMMON_SRC = $(wildcard common/*.c)
# The engine's libraries stay out of the client: it links only these.
CLIENT_COMMON_SRC = $(filter-out common/image.c common/image_%.c common/exr_%.c common/png_%.c common/tiff%.c common/jpeg.c common/heif%.c common/webp.c common/hdr.c common/exif.c common/color.c common/color_%.c,$(COMMON_SRC))
CLIENT_SRC = $(wildcard client/*.c)
SERVER_SRC = $(wildcard server/*.c server/*/*.c server/*/*/*.c)
SERVER_LIB_SRC = $(filter-out server/main.c,$(SERVER_SRC))
# The web page: server/web/, and three.js of Debian's libjs-three.
PAGE_FILES = $(wildcard server/web/*.css server/web/*.js)
THREE_JS = /usr/share/javascript/three/three.module.js
EMBEDDED = server/http/openapi.json server/web/index.html $(PAGE_FILES)
CLIENT_LIB_SRC = $(filter-out client/main.c,$(CLIENT_SRC))
TEST_SRC = $(wildcard tests/unit/*.c tests/gradient/*.c tests/render/*.c tests/api/*.c tests/chaos/*.c \
                      tests/soak/*.c)
BENCH_SRC = $(wildcard tests/bench/*.c)
FUZZ_SRC = $(wildcard tests/fuzz/test_*.c)
# Tests that are built, as patterns of names without .c, and of what is no test what lies in their folders.
TESTS ?= %
built = $(foreach s,$(1),$(filter $(if $(filter test_%,$(notdir $(s))),$(TESTS:%=tests/%.c),$(addsuffix %,$(dir $(TESTS:%=tests/%)))),$(s)))
# Hundreds of tests are linked with nearly all of the engine: gold, where it is, takes a third of ld's time.
GOLD = $(if $(shell command -v ld.gold),-fuse-ld=gold)
TEST_LDFLAGS = $(ALL_LDFLAGS) $(GOLD)

obj = $(patsubst %.c,$(B)/obj/%.o,$(1))
TEST_BIN = $(patsubst tests/%.c,$(B)/tests/%,$(call built,$(TEST_SRC)))
PRELOAD = $(patsubst tests/%.c,$(B)/tests/%.so,$(wildcard tests/chaos/preload/*.c))
BENCH_BIN = $(patsubst tests/%.c,$(B)/tests/%,$(BENCH_SRC))
FUZZ_BIN = $(patsubst tests/%.c,$(B)/tests/%,$(call built,$(FUZZ_SRC)))

# The goals that build first and then run something build on all processors, unless told otherwise.
BUILD = echo building... && $(MAKE) -s $(if $(filter -j%,$(MAKEFLAGS)),,-j$(shell nproc))

.PHONY: all help deps man deb demo test tests blender check check-build benches bench fidelity light rooms sensitivity relight paper many chaos soak asan tsan asan-build tsan-build fuzz \
        fuzzers fuzz-build portable format coverage coverage-build install clean
.SECONDARY:
.DELETE_ON_ERROR:

all: $(B)/unbaked $(B)/unbake ## build the daemon and the client

help: ## list the targets
	@awk -F':.*## ' '/^[a-z-]+:.*## /{printf "make %-10s %s\n", $$1, $$2}' Makefile

deps: ## install the Debian packages that are missing (root or sudo)
	@deploy/install-deps.sh

# The kernels of the engine: loops that must vectorise. No floating-point exception is ever read.
KERNEL_CFLAGS =
$(B)/obj/server/render/%.o: ALL_CFLAGS += -O3 -fno-trapping-math $(KERNEL_CFLAGS)

# Tests are compiled in a hurry, as a third of the build is theirs: what they wait for is the engine. Not benches, which
# measure, nor fuzz targets.
TEST_CFLAGS ?= -O1 -g1
$(foreach d,unit gradient render api chaos soak,$(B)/obj/tests/$(d)/%.o): ALL_CFLAGS += $(TEST_CFLAGS)

$(B)/obj/%.o: %.c
	@mkdir -p $(@D)
	$(CC) $(ALL_CFLAGS) -MMD -MP -c -o $@ $<

# Files that travel inside the binary, as the assembler takes them in; declared in server/http/embedded.h.
embed = s=embedded_$$(printf %s '$(notdir $(1))' | tr -c 'a-zA-Z0-9' _); \
	printf '%s\n' .section\ .rodata ".global $$s, $${s}_size" "$$s: .incbin \"$<\"" 0: ".balign 8" "$${s}_size: .quad 0b - $$s" \
	    '.section .note.GNU-stack,"",%progbits' > $@
$(B)/embed/%.s: %
	@mkdir -p $(@D)
	@$(call embed,$*)
$(B)/embed/three.module.js.s: $(THREE_JS)
	@mkdir -p $(@D)
	@$(call embed,three.module.js)
$(THREE_JS):
	@echo "$@ is missing: make deps installs libjs-three" >&2; exit 1
# The page's files by name. It is written anew where a file has come or gone.
$(B)/embed/page.c: server/web Makefile
	@mkdir -p $(@D)
	@names='$(notdir $(PAGE_FILES) $(THREE_JS))'; symbols() { echo "$$1" | tr -c 'a-zA-Z0-9\n' _; }; \
	{ echo '#include "server/http/embedded.h"'; \
	  for n in $$names; do s=$$(symbols "$$n"); \
	    echo "extern const unsigned char embedded_$$s[]; extern const size_t embedded_$${s}_size;"; done; \
	  echo 'const struct embedded_file embedded_page[] = {'; \
	  for n in $$names; do s=$$(symbols "$$n"); \
	    echo "    {\"$$n\", embedded_$$s, &embedded_$${s}_size},"; done; echo '    {0}};'; } > $@
# What tells a daemon and a node apart that were built from other sources; declared in common/source_digest.h.
SOURCES = $(sort $(COMMON_SRC) $(SERVER_SRC) $(wildcard common/*.h server/*.h server/*/*.h server/*/*/*.h))
$(B)/embed/source_digest.c: $(SOURCES)
	@mkdir -p $(@D)
	@{ printf '#include "common/protocol.h"\n#include "common/source_digest.h"\n'; \
	   printf 'const char source_version[] = UNBAKE_VERSION " (sources %.16s)";\n' "$$(cat $(SOURCES) | sha256sum)"; } > $@
$(B)/obj/embed/%.o: $(B)/embed/%.s
	@mkdir -p $(@D)
	$(CC) -c -o $@ $<
$(B)/obj/embed/page.o $(B)/obj/embed/source_digest.o: $(B)/obj/embed/%.o: $(B)/embed/%.c
	@mkdir -p $(@D)
	$(CC) $(ALL_CFLAGS) -MMD -MP -c -o $@ $<

$(B)/libcommon.a: $(call obj,$(COMMON_SRC))
	@rm -f $@
	ar rcs $@ $^
$(B)/libserver.a: $(call obj,$(SERVER_LIB_SRC)) $(patsubst %,$(B)/obj/embed/%.o,$(EMBEDDED) three.module.js page source_digest)
	@rm -f $@
	ar rcs $@ $^
$(B)/libclient.a: $(call obj,$(CLIENT_LIB_SRC))
	@rm -f $@
	ar rcs $@ $^

$(B)/unbaked: $(call obj,server/main.c) $(B)/libserver.a $(B)/libcommon.a
	$(CC) $(ALL_LDFLAGS) -o $@ $^ $(SERVER_LIBS)

$(B)/unbake: $(call obj,client/main.c $(CLIENT_LIB_SRC) $(CLIENT_COMMON_SRC))
	$(CC) $(ALL_LDFLAGS) -o $@ $^ $(CLIENT_LIBS)

$(B)/tests/%: $(B)/obj/tests/%.o $(B)/libserver.a $(B)/libclient.a $(B)/libcommon.a
	@mkdir -p $(@D)
	$(CC) $(TEST_LDFLAGS) -o $@ $< $(B)/libclient.a $(B)/libserver.a $(B)/libcommon.a $(SERVER_LIBS) $(TEST_LIBS)
# What runs a fuzz target: driver.c, or libFuzzer where make fuzz says so.
FUZZ_DRIVER = $(B)/obj/tests/fuzz/driver.o
$(B)/tests/fuzz/%: $(B)/obj/tests/fuzz/%.o $(B)/obj/tests/fuzz/seeds.o $(FUZZ_DRIVER) \
                   $(B)/libclient.a $(B)/libserver.a $(B)/libcommon.a
	@mkdir -p $(@D)
	$(CC) $(TEST_LDFLAGS) -o $@ $^ $(SERVER_LIBS)
$(B)/tests/unit/test_image_formats: TEST_LIBS = -lwebpmux
# Each parallel loop passes through cores.h, which measures it on demand.
$(B)/tests/bench/reconstruct_room: TEST_LIBS = -Wl,--wrap=parallel_for
$(B)/tests/bench/perturb_mesh: TEST_LIBS = $(if $(wildcard /usr/include/meshoptimizer.h),-lmeshoptimizer)

# What a test slips under a program of ours.
$(B)/tests/%.so: tests/%.c $(wildcard tests/*.h tests/chaos/*.h)
	@mkdir -p $(@D)
	$(CC) $(ALL_CFLAGS) -shared -fPIC -o $@ $< -ldl

# With T=name only the tests that have it in their names are built, and what scripts among them need.
HELPER_BIN = $(foreach t,$(TEST_BIN),$(if $(filter test_%,$(notdir $(t))),,$(t)))
named = $(foreach t,$(1),$(if $(findstring $(T),$(patsubst $(B)/tests/%,%,$(t))),$(t)))
SCRIPTS = $(call named,$(patsubst tests/%.sh,$(B)/tests/%,$(wildcard tests/*/test_*.sh)))
SELECTED_BIN = $(if $(T),$(call named,$(TEST_BIN) $(FUZZ_BIN)) $(if $(SCRIPTS),$(HELPER_BIN) $(PRELOAD)),\
                         $(TEST_BIN) $(FUZZ_BIN) $(PRELOAD))
tests: all $(SELECTED_BIN)
benches: all $(BENCH_BIN)

demo: deps ## make a room, reconstruct it, show where the pictures are
	@+$(BUILD) all
	@tests/demo.sh $(B)

test: deps ## build and run all tests, a few also under the sanitizers; T=name: only those (T=adam); LONG=1: in their long form
	@+$(BUILD) tests $(if $(T),,benches FUZZ_SRC=)
	@$(if $(LONG),UNBAKE_LONG=1 TEST_TIMEOUT=86400) tests/run.sh "$(T)" $(B) $(if $(T),,build/short/asan build/short/tsan)

CHECK_BIN = $(filter $(B)/tests/unit/% $(B)/tests/gradient/% $(B)/tests/render/test_furnace \
                     $(B)/tests/render/test_principled,$(TEST_BIN))
check: ## what a change needs while it is written: unit, gradient, closed forms, one small job; under a minute
	@+$(BUILD) check-build
	@TEST_SET=check tests/run.sh "" $(B)
check-build: all $(CHECK_BIN)

bench: ## print the speed ratios and write build/bench.json; LONG=1: also what takes many minutes
	@deploy/install-deps.sh bench
	@+$(BUILD) benches
	@LONG=$(LONG) tests/bench/run.sh $(B)

fidelity: deps ## compare with the truth of known rooms, some 6 minutes each; FIDELITY_QUALITY, FIDELITY_ROOMS
	@+$(BUILD) all $(B)/tests/bench/reconstruct_room $(B)/tests/bench/scan_scores $(B)/tests/bench/scan_ceiling
	@tests/bench/fidelity.sh $(B)

light: deps ## compare the light that is found with that of known rooms (make rooms); LIGHT_ROOMS, LIGHT_KINDS, LIGHT_QUALITY
	@+$(BUILD) all $(B)/tests/bench/reconstruct_room
	@tests/bench/light.sh $(B)

rooms: ## make furnished rooms with their truth, by Mitsuba 3, under build/rooms, for FIDELITY_ROOMS and LIGHT_ROOMS; ROOM_NAMES, ROOM_SPP
	@deploy/install-deps.sh rooms
	@tests/bench/rooms.sh $(B)

relight: deps ## compare rooms in another light with the true rooms in that light; RELIGHT_ROOMS, RELIGHT_QUALITY; writes build/relight.json
	@deploy/install-deps.sh bench
	@+$(BUILD) all $(B)/tests/bench/reconstruct_room $(B)/tests/render/relight_room
	@tests/bench/relight.sh $(B)

sensitivity: deps ## how much results move with each constant of the engine (hours); SENSITIVITY="server/material ..."
	@+$(BUILD) all
	@tests/bench/sensitivity.sh $(B)

paper: ## repeat the paper's experiments (hours; PAPER=short: minutes, to see that they run), write build/paper.json
	@deploy/install-deps.sh bench
	@+$(BUILD) all $(B)/tests/bench/reconstruct_room $(B)/tests/bench/perturb_mesh
	@tests/bench/paper.sh $(B)

many: deps ## reconstruct from 300 photographs of 12 megapixels (half an hour), print the peak memory; MANY_FACTOR, MANY_MIB
	@+$(BUILD) all $(B)/tests/bench/reconstruct_room $(B)/tests/bench/enlarge_room
	@tests/bench/many_photographs.sh $(B)

asan: deps ## run all tests under the address and undefined-behaviour sanitizers
	@+$(BUILD) asan-build
	@tests/run.sh "$(T)" build/asan

tsan: deps ## run all tests under the thread sanitizer
	@+$(BUILD) tsan-build
	@tests/run.sh "$(T)" build/tsan

# Lines of calls are all that a sanitizer's report wants of -g, which takes a sixth of a build's time. Of
# SANITIZED_TESTS=short, which run for a minute or two, the build is most of the time: all but the kernels is
# compiled in a hurry.
SANITIZED_B = build$(if $(SANITIZED_TESTS),/short)
SANITIZED = CFLAGS="$(if $(SANITIZED_TESTS),-O0,-O1) -g1" TEST_CFLAGS="-O0 -g1" \
            $(if $(SANITIZED_TESTS),TESTS="$(subst *,%,$(shell tests/run.sh --short $(1)))")
asan-build:
	@$(MAKE) --no-print-directory B=$(SANITIZED_B)/asan $(call SANITIZED,asan) \
	    SANITIZE="-fsanitize=address,undefined -fno-sanitize-recover=all -fno-omit-frame-pointer" tests
tsan-build:
	@$(MAKE) --no-print-directory B=$(SANITIZED_B)/tsan $(call SANITIZED,tsan) SANITIZE="-fsanitize=thread" tests

chaos: deps ## kill, cut off and mislead the daemon at length; writes build/chaos.json; T=name runs one
	@+$(BUILD) tests
	@tests/long.sh chaos $(B) "$(T)"

soak: deps ## many clients for a long time; writes build/soak.json; T=name runs one
	@+$(BUILD) tests
	@tests/long.sh soak $(B) "$(T)"

blender: deps ## render scene.usda in Blender (PyPI's bpy, 350 MB) and compare with our picture of the room
	@+$(BUILD) tests
	@tests/render/blender.sh $(abspath $(B))

FUZZ_SECONDS ?= 60
FUZZ_RUNS ?= -1
fuzz: deps ## search for crashes with libFuzzer, FUZZ_SECONDS (60) or FUZZ_RUNS a target; writes build/fuzz.json; T=name runs one
	@deploy/install-deps.sh fuzz
	@+$(BUILD) fuzzers fuzz-build
	@FUZZ_SECONDS=$(FUZZ_SECONDS) FUZZ_RUNS=$(FUZZ_RUNS) tests/fuzz/fuzz.sh $(B) "$(T)"

fuzzers: $(FUZZ_BIN)
# clang has another way to say that a sanitizer is there. The kernels, which parse nothing, are checked, but do
# not guide the search: that takes half of their time.
fuzz-build:
	@$(MAKE) --no-print-directory B=build/fuzz CC=clang CFLAGS="-O1 -g" GOLD= FUZZ_DRIVER= LDFLAGS=-fsanitize=fuzzer \
	    CPPFLAGS=-D__SANITIZE_ADDRESS__=1 KERNEL_CFLAGS=-fno-sanitize=fuzzer-no-link \
	    SANITIZE="-fsanitize=fuzzer-no-link,address,undefined,float-cast-overflow -fno-sanitize-recover=all \
	    -fno-omit-frame-pointer" fuzzers

coverage: deps ## run the tests and say what share of the code they reach; writes build/coverage.json; T=name runs one
	@deploy/install-deps.sh coverage
	@+$(BUILD) coverage-build
	@tests/coverage.sh build/coverage "$(T)"

format: ## lay out all C files as .clang-format has it (clang-format 14)
	@deploy/install-deps.sh format
	@git ls-files -z '*.c' '*.h' | xargs -0 $$(command -v clang-format-14 || echo clang-format) -i

portable: deps ## build and check on the next Debian (trixie), in a throw-away root under build/portable; needs root
	@deploy/install-deps.sh portable
	@tests/portable.sh $(B)

# Counts are written when a process ends, and (as fork and execv are the compiler's in GNU C) before it becomes
# another program. Threads may lose some, which does not matter: a line that ran is not 0.
coverage-build:
	@$(MAKE) --no-print-directory B=build/coverage CFLAGS="-O1 -g -std=gnu11" SANITIZE=--coverage \
	    CPPFLAGS='-DCOVERAGE_DIR=\"$(CURDIR)/build/coverage/obj\"' tests

# Manual pages and completions come out of the programs, from the tables of their --help.
MANUALS = $(B)/man/unbake.1 $(B)/man/unbaked.8 $(B)/man/unbaked.conf.5
COMPLETIONS = $(foreach p,unbake unbaked,$(B)/completion/$(p).bash $(B)/completion/$(p).zsh)
$(B)/man/unbake.1: $(B)/unbake
	@mkdir -p $(@D)
	$< manual $(@F) > $@
$(B)/man/unbaked.%: $(B)/unbaked
	@mkdir -p $(@D)
	$< manual $(@F) > $@
$(B)/completion/%.bash: $(B)/%
	@mkdir -p $(@D)
	$< manual bash > $@
$(B)/completion/%.zsh: $(B)/%
	@mkdir -p $(@D)
	$< manual zsh > $@

man: $(MANUALS) ## write the manual pages to build/man

SHARE = $(DESTDIR)$(PREFIX)/share
BASH_COMPLETIONS ?= $(PREFIX)/share/bash-completion/completions
ZSH_COMPLETIONS ?= $(PREFIX)/share/zsh/site-functions
install: all $(MANUALS) $(COMPLETIONS) ## install under PREFIX (/usr/local)
	install -d $(DESTDIR)$(PREFIX)/bin $(SHARE)/unbake/executors.d $(SHARE)/man/man1 $(SHARE)/man/man5 $(SHARE)/man/man8 \
	    $(DESTDIR)$(BASH_COMPLETIONS) $(DESTDIR)$(ZSH_COMPLETIONS)
	install -m 755 $(B)/unbaked $(B)/unbake $(DESTDIR)$(PREFIX)/bin
	install -m 644 config/unbaked.conf $(SHARE)/unbake/unbaked.conf
	install -m 644 config/executors.d/*.conf $(SHARE)/unbake/executors.d
	install -m 755 config/executors.d/ssh-hosts $(SHARE)/unbake/executors.d
	install -m 644 $(B)/man/unbake.1 $(SHARE)/man/man1
	install -m 644 $(B)/man/unbaked.conf.5 $(SHARE)/man/man5
	install -m 644 $(B)/man/unbaked.8 $(SHARE)/man/man8
	for p in unbake unbaked; do \
	    install -m 644 $(B)/completion/$$p.bash $(DESTDIR)$(BASH_COMPLETIONS)/$$p && \
	    install -m 644 $(B)/completion/$$p.zsh $(DESTDIR)$(ZSH_COMPLETIONS)/_$$p || exit 1; done

VERSION = $(shell sed -n 's/^\#define UNBAKE_VERSION "\(.*\)"/\1/p' common/protocol.h)
deb: ## build the Debian packages into build/deb (needs the packages that deploy/deb.sh names)
	@deploy/deb.sh $(B)/deb $(VERSION)

clean: ## remove what was built
	rm -rf build

-include $(shell find $(B)/obj -name '*.d' 2>/dev/null)
