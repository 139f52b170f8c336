/* gltf_node.c -- see gltf_node.h. */
#include "server/ingest/gltf_node.h"

#include <math.h>
#include <string.h>

struct affine affine_multiply(const struct affine *a, const struct affine *b) {
    struct affine c;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 4; j++)
            c.m[i][j] = a->m[i][0] * b->m[0][j] + a->m[i][1] * b->m[1][j] + a->m[i][2] * b->m[2][j] +
                        (j == 3 ? a->m[i][3] : 0.0);
    return c;
}

void affine_cofactors(const struct affine *a, double c[3][3]) {
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
            c[i][j] = a->m[i1][j1] * a->m[i2][j2] - a->m[i1][j2] * a->m[i2][j1];
        }
    }
}

/* `count` finite numbers, or the fallback's when the member is absent. */
static enum status read_numbers(const struct gltf_file *g, size_t node, const char *key, int count,
                                const double *fallback, double *value, struct error *err) {
    const cJSON *array = cJSON_GetObjectItemCaseSensitive(g->nodes.item[node], key), *item;
    int i = 0;
    memcpy(value, fallback, (size_t)count * sizeof *value);
    if (!array)
        return STATUS_OK;
    bool good = cJSON_GetArraySize(array) == count;
    cJSON_ArrayForEach(item, array) {
        good = good && cJSON_IsNumber(item) && isfinite(item->valuedouble);
        if (good)
            value[i++] = item->valuedouble;
    }
    if (good)
        return STATUS_OK;
    return error_set(err, STATUS_INPUT, "%s: nodes[%zu].%s is not %d numbers", g->name, node, key, count);
}

enum status gltf_node_transform(const struct gltf_file *g, size_t node, struct affine *t, struct error *err) {
    static const double identity[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    static const double none[4] = {0, 0, 0, 1}, one[3] = {1, 1, 1};
    double matrix[16], move[3], q[4], scale[3];
    enum status status = read_numbers(g, node, "matrix", 16, identity, matrix, err);
    if (status == STATUS_OK)
        status = read_numbers(g, node, "translation", 3, none, move, err);
    if (status == STATUS_OK)
        status = read_numbers(g, node, "rotation", 4, none, q, err);
    if (status == STATUS_OK)
        status = read_numbers(g, node, "scale", 3, one, scale, err);
    if (status != STATUS_OK)
        return status;
    double x = q[0], y = q[1], z = q[2], w = q[3];
    const double turn[3][3] = {
        {1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)},
        {2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)},
        {2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)},
    };
    struct affine trs, columns;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 4; j++) {
            columns.m[i][j] = matrix[4 * j + i];
            trs.m[i][j] = j < 3 ? turn[i][j] * scale[j] : move[i];
        }
    }
    *t = affine_multiply(&columns, &trs); /* a node has either a matrix or TRS */
    return STATUS_OK;
}
