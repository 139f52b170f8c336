/* markov_field.h: parts and their bands; the field against the normal equations, solved as a dense system. */
#include "server/refine/markov_field.h"

#include <math.h>

#include "common/cholesky.h"
#include "common/mem.h"
#include "common/rng.h"
#include "tests/check.h"

/* A plan of cells: letters are charts, between which there are no neighbours; the last ones of b are apart from it. */
#define ROWS 5
#define COLUMNS 12
static const char plan[ROWS][COLUMNS + 1] = {
    "aaaaaa..bbbb", "aaaaaaccb..b", "a....accbbbb", "aaaaaacc....", ".......c.bbb",
};
#define CELLS_MOST (ROWS * COLUMNS)

static uint32_t neighbour[CELLS_MOST][4], number[ROWS][COLUMNS];
static size_t count;

static uint32_t cell_at(int row, int column, char chart) {
    bool is_there = row >= 0 && column >= 0 && row < ROWS && column < COLUMNS && plan[row][column] == chart;
    return is_there ? number[row][column] : MARKOV_NONE;
}

static void make_cells(void) {
    for (int i = 0; i < CELLS_MOST; i++)
        if (plan[i / COLUMNS][i % COLUMNS] != '.')
            number[i / COLUMNS][i % COLUMNS] = (uint32_t)count++;
    for (int row = 0; row < ROWS; row++) {
        for (int column = 0; column < COLUMNS; column++) {
            char chart = plan[row][column];
            if (chart == '.')
                continue;
            uint32_t *to = neighbour[number[row][column]];
            to[0] = cell_at(row, column - 1, chart);
            to[1] = cell_at(row, column + 1, chart);
            to[2] = cell_at(row - 1, column, chart);
            to[3] = cell_at(row + 1, column, chart);
        }
    }
}

/* The field of all cells at once. */
static void solve_dense(const struct markov_precision *p, double *x) {
    double *a = mem_calloc(count * count, sizeof *a);
    for (size_t i = 0; i < count; i++) {
        a[i * count + i] = p->prior + p->observed[i];
        x[i] *= p->observed[i];
        for (int k = 0; k < 4; k++) {
            if (neighbour[i][k] == MARKOV_NONE)
                continue;
            a[i * count + i] += p->smoothness;
            a[i * count + neighbour[i][k]] -= p->smoothness;
        }
    }
    CHECK(cholesky_factor(count, count, a));
    cholesky_solve(count, count, a, x);
    mem_free(a);
}

static void check_parts(const struct markov_field *f) {
    size_t sizes = 0;
    CHECK(f->part_count == 4); /* a, b, c, and b's last ones */
    for (size_t part = 0; part < f->part_count; part++) {
        for (uint32_t i = f->first[part]; i < f->first[part + 1]; i++)
            CHECK(f->place[f->cell[i]] == i - f->first[part]);
        sizes += f->first[part + 1] - f->first[part];
        CHECK_THAT(f->band[part] <= 4, "part %zu has a band of %u", part, f->band[part]);
    }
    CHECK(sizes == count);
}

int main(void) {
    struct markov_field f;
    double observed[CELLS_MOST], value[CELLS_MOST], wanted[CELLS_MOST];
    const struct markov_precision precision = {25.0, 2500.0, observed};
    make_cells();
    for (size_t i = 0; i < count; i++) {
        uint32_t bits = (uint32_t)rng_key(3, i, 0);
        observed[i] = bits % 3 == 0 ? 0.0 : 5000.0 * (double)rng_to_float(bits);
        value[i] = wanted[i] = (double)rng_to_float((uint32_t)rng_key(3, i, 1)) - 0.5;
    }
    solve_dense(&precision, wanted);
    markov_field_init(&f, count, (const uint32_t(*)[4])neighbour);
    check_parts(&f);
    for (size_t part = 0; part < f.part_count; part++)
        markov_field_solve(&f, part, &precision, value);
    for (size_t i = 0; i < count; i++)
        CHECK_NEAR(value[i], wanted[i], 1e-12);
    markov_field_release(&f);
    markov_field_init(&f, 0, NULL);
    CHECK(f.part_count == 0);
    markov_field_release(&f);
    return check_result();
}
