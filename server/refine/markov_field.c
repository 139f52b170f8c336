/* markov_field.c -- see markov_field.h. */
#include "server/refine/markov_field.h"

#include "common/cholesky_band.h"
#include "common/mem.h"

/* Appends the cells that are connected with `start` to f->cell from entry `at` on, by their distance from it, and
 * numbers them from `at` on; returns the end. `place` of cells that were not reached is MARKOV_NONE. */
static size_t spread(struct markov_field *f, uint32_t start, size_t at) {
    size_t end = at;
    f->place[start] = 0;
    f->cell[end++] = start;
    for (size_t i = at; i < end; i++) {
        for (int k = 0; k < 4; k++) {
            uint32_t beside = f->neighbour[f->cell[i]][k];
            if (beside == MARKOV_NONE || f->place[beside] != MARKOV_NONE)
                continue;
            f->place[beside] = (uint32_t)(end - at);
            f->cell[end++] = beside;
        }
    }
    return end;
}

static uint32_t band_of(const struct markov_field *f, size_t begin, size_t end) {
    uint32_t band = 0;
    for (size_t i = begin; i < end; i++) {
        for (int k = 0; k < 4; k++) {
            uint32_t beside = f->neighbour[f->cell[i]][k];
            if (beside != MARKOV_NONE && f->place[beside] > i - begin + band)
                band = (uint32_t)(f->place[beside] - (i - begin));
        }
    }
    return band;
}

/* A cell that is farthest from any other lies at the part's rim, from which fewer are equally far. */
void markov_field_init(struct markov_field *f, size_t count, const uint32_t (*neighbour)[4]) {
    *f = (struct markov_field){.count = count, .neighbour = neighbour};
    f->first = mem_calloc(count + 1, sizeof *f->first);
    f->cell = mem_array(count + 1, sizeof *f->cell);
    f->place = mem_array(count + 1, sizeof *f->place);
    f->band = mem_array(count + 1, sizeof *f->band);
    for (size_t i = 0; i < count; i++)
        f->place[i] = MARKOV_NONE;
    for (size_t i = 0, at = 0; i < count; i++) {
        if (f->place[i] != MARKOV_NONE)
            continue;
        size_t end = spread(f, (uint32_t)i, at);
        uint32_t farthest = f->cell[end - 1];
        for (size_t k = at; k < end; k++)
            f->place[f->cell[k]] = MARKOV_NONE;
        spread(f, farthest, at);
        f->band[f->part_count++] = band_of(f, at, end);
        f->first[f->part_count] = (uint32_t)end;
        at = end;
    }
}

void markov_field_release(struct markov_field *f) {
    mem_free(f->first);
    mem_free(f->cell);
    mem_free(f->place);
    mem_free(f->band);
    *f = (struct markov_field){0};
}

/* The equation of one cell of a part, into row `i` of the matrix. */
static void add_equation(const struct markov_field *f, const uint32_t *cell, size_t i, size_t band,
                         const struct markov_precision *precision, double *matrix) {
    double *diagonal = matrix + i * (band + 1) + band;
    *diagonal = precision->prior + precision->observed[cell[i]];
    for (int k = 0; k < 4; k++) {
        uint32_t beside = f->neighbour[cell[i]][k];
        if (beside == MARKOV_NONE)
            continue;
        *diagonal += precision->smoothness;
        if (f->place[beside] < i)
            diagonal[-(long)(i - f->place[beside])] = -precision->smoothness;
    }
}

void markov_field_solve(const struct markov_field *f, size_t part, const struct markov_precision *precision,
                        double *value) {
    const uint32_t *cell = f->cell + f->first[part];
    size_t n = f->first[part + 1] - f->first[part], band = f->band[part];
    double *matrix = mem_calloc(n * (band + 1), sizeof *matrix), *x = mem_array(n, sizeof *x);
    for (size_t i = 0; i < n; i++) {
        add_equation(f, cell, i, band, precision, matrix);
        x[i] = precision->observed[cell[i]] * value[cell[i]];
    }
    cholesky_band_factor(n, band, matrix);
    cholesky_band_solve(n, band, matrix, x);
    for (size_t i = 0; i < n; i++)
        value[cell[i]] = x[i];
    mem_free(x);
    mem_free(matrix);
}
