/* sky_cells.c -- see sky_cells.h. */
#include "server/light/sky/sky_cells.h"

#include <math.h>

#include "server/scene/latlong.h"

struct sky_corners sky_cells_around(vec3 direction) {
    struct latlong at = latlong_of(direction); /* the centres of cells are half a cell in, both ways: this is no map */
    double x = at.around * SKY_COLUMNS - 0.5, y = at.down * SKY_ROWS - 0.5;
    double column = floor(x), row = floor(y);
    float fx = (float)(x - column), fy = (float)(y - row);
    struct sky_corners c;
    for (int i = 0; i < 4; i++) {
        int at_x = ((int)column + i % 2 + SKY_COLUMNS) % SKY_COLUMNS, at_y = (int)row + i / 2;
        at_y = at_y < 0 ? 0 : at_y >= SKY_ROWS ? SKY_ROWS - 1 : at_y;
        c.cell[i] = (size_t)(at_y * SKY_COLUMNS + at_x);
        c.weight[i] = (i % 2 ? fx : 1.0f - fx) * (i / 2 ? fy : 1.0f - fy);
    }
    return c;
}

size_t sky_cells_half(size_t cell) { return cell / SKY_COLUMNS >= SKY_ROWS / 2; }

double sky_cells_radiance(const double log_radiance[SKY_CELLS], vec3 direction) {
    struct sky_corners c = sky_cells_around(direction);
    double radiance = 0.0;
    for (int k = 0; k < 4; k++)
        radiance += (double)c.weight[k] * exp(log_radiance[c.cell[k]]);
    return radiance;
}
