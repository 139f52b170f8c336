/* test_sources.c -- every source of captures, of files in memory: the input is a line "@NAME" for each of them and its
 * content. */
#include "server/ingest/source/sources.h"

#include <math.h>

#include "tests/fuzz/fuzz.h"

#define FILES 16

/* Splits the input; returns how many files there are. */
static size_t split(const char *text, size_t size, char name[FILES][64], struct listed_file file[FILES]) {
    size_t count = 0, at = 0;
    while (at < size && text[at] == '@' && count < FILES) {
        size_t end = at + 1, length = 0;
        for (; end < size && text[end] != '\n'; end++)
            if (length < 63 && text[end] != '\0')
                name[count][length++] = text[end];
        name[count][length] = '\0';
        at = end < size ? end + 1 : size;
        const char *next = memmem(text + at, size - at, "\n@", 2);
        size_t stop = next ? (size_t)(next - text) + 1 : size;
        if (length > 0)
            file[count] = (struct listed_file){name[count], stop - at, text + at}, count++;
        at = stop;
    }
    return count;
}

static void check_frames(const struct frames *t) {
    struct error err;
    MUST(t->frame_count <= t->named_count && t->named_count <= FRAMES_MAX + 1);
    for (size_t i = 0; i < t->frame_count; i++) {
        struct camera camera;
        MUST(t->frame[i].file && t->frame[i].file[0] && isfinite(t->frame[i].world_from_camera.translation[0]));
        if (frame_camera(&t->frame[i], 64, 48, (double[3]){0}, &camera, &err) == STATUS_OK)
            MUST(isfinite(camera.fx) && isfinite(camera.fy) && isfinite(camera.cx) && isfinite(camera.cy));
    }
}

static void read(const struct source *source, const struct listing *l, const char *base) {
    struct findings f = {.problems = cJSON_CreateArray()};
    struct frames t;
    struct error err = {.message = ""};
    char *found = source->recognise(l, base);
    struct source_place place = {l, base, found};
    if (found) {
        MUST(source->read(&place, &t, &f, &err) == STATUS_OK);
        check_frames(&t);
        frames_release(&t);
    }
    cJSON_Delete(f.problems);
    findings_release(&f);
    free(found);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static char name[FILES][64];
    struct listed_file file[FILES];
    struct listing l;
    listing_of_memory(&l, file, split((const char *)data, size, name, file));
    for (size_t i = 0; i < l.folder_count; i++)
        for (size_t k = 0; sources_get(k); k++)
            read(sources_get(k), &l, l.folder[i]);
    listing_release(&l);
    return 0;
}

void fuzz_seeds(struct seeds *s) { s->mutants = 10000; }
