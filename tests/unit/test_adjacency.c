/* adjacency.h: a mesh is closed where two triangles or more meet at each edge, also where vertices are repeated. */
#include "server/scene/adjacency.h"

#include "tests/check.h"

static bool is_closed(size_t triangles, size_t vertices, uint32_t (*index)[3], vec3 *position) {
    struct mesh mesh = {.vertex_count = vertices, .position = position, .triangle_count = triangles, .index = index};
    struct adjacency adjacency;
    adjacency_make(&adjacency, &mesh);
    bool closed = adjacency_is_closed(&adjacency, &mesh);
    adjacency_release(&adjacency);
    return closed;
}

int main(void) {
    /* A tetrahedron, and a wall within it that hangs on one of its edges. */
    static uint32_t shared[][3] = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}, {0, 1, 4}};
    static vec3 corner[] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0.2f, 0.2f, 0.2f}};
    static uint32_t apart[4][3];
    static vec3 repeated[12];
    for (uint32_t t = 0; t < 4; t++) {
        for (uint32_t k = 0; k < 3; k++) {
            apart[t][k] = 3 * t + k;
            repeated[3 * t + k] = corner[shared[t][k]];
        }
    }
    CHECK(is_closed(4, 5, shared, corner));
    CHECK(is_closed(4, 12, apart, repeated));
    CHECK(!is_closed(3, 5, shared, corner));
    CHECK(!is_closed(3, 12, apart, repeated));
    CHECK(!is_closed(5, 5, shared, corner));
    return check_result();
}
