/* test_mesh_ply.c -- scene.ply read back: places, atlas coordinates, order, seams. */
#include "server/export/mesh_ply.h"

#include "common/buf.h"
#include "common/file.h"
#include "common/mem.h"
#include "tests/check.h"

/* Two quads that meet at a right angle, over the edge of vertices 1 and 2, cut 012 023. */
static void make_mesh(struct mesh *mesh) {
    static const vec3 position[6] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {1, 0, 1}, {1, 1, 1}};
    static const uint32_t index[4][3] = {{0, 1, 2}, {0, 2, 3}, {1, 4, 5}, {1, 5, 2}};
    *mesh = (struct mesh){.vertex_count = 6, .triangle_count = 4, .face_count = 2};
    mesh->position = mem_array(6, sizeof *mesh->position);
    mesh->normal = mem_calloc(6, sizeof *mesh->normal);
    mesh->index = mem_array(4, sizeof *mesh->index);
    mesh->face = mem_array(4, sizeof *mesh->face);
    memcpy(mesh->position, position, sizeof position);
    memcpy(mesh->index, index, sizeof index);
    for (uint32_t t = 0; t < 4; t++)
        mesh->face[t] = t / 2;
}

static float float_at(const char *at) {
    float value;
    memcpy(&value, at, sizeof value);
    return value;
}

static uint32_t word_at(const char *at) {
    uint32_t value;
    memcpy(&value, at, sizeof value);
    return value;
}

static void check_file(const char *text, size_t length, const struct mesh *mesh, const struct segments *segments,
                       const struct atlas *atlas) {
    const char *end = strstr(text, "end_header\n");
    const char *count = strstr(text, "element vertex ");
    CHECK(end && count && strstr(text, "element face 4\n"));
    if (!end || !count)
        return;
    size_t vertex_count = (size_t)atoi(count + 15);
    CHECK_THAT(vertex_count == 8, "%zu", vertex_count); /* both ends of the fold are there twice */
    const char *vertex = end + 11, *face = vertex + 32 * vertex_count;
    CHECK_THAT(face + 4 * 21 == text + length, "%zu bytes", length);
    for (uint32_t t = 0; t < 4; t++, face += 21) {
        CHECK(face[0] == 3);
        CHECK(word_at(face + 13) == segments->of_triangle[t]);
        CHECK(word_at(face + 17) == t / 2);
        for (uint32_t c = 0; c < 3; c++) {
            uint32_t v = word_at(face + 1 + 4 * c);
            CHECK(v < vertex_count);
            const char *at = vertex + 32 * v;
            vec3 p = mesh->position[mesh->index[t][c]];
            CHECK(float_at(at) == p.x && float_at(at + 4) == p.y && float_at(at + 8) == p.z);
            CHECK_NEAR(float_at(at + 24) * (float)atlas->width, atlas->corner[t][c].x, 1e-4);
            CHECK_NEAR((1.0f - float_at(at + 28)) * (float)atlas->height, atlas->corner[t][c].y, 1e-4);
        }
    }
}

int main(void) {
    struct mesh mesh;
    struct segments segments;
    struct atlas atlas;
    struct error err = {0};
    make_mesh(&mesh);
    mesh.object_id = mem_calloc(4, sizeof *mesh.object_id);
    mesh.object_id[2] = mesh.object_id[3] = 9;
    mesh.name_count = 10;
    mesh.name = mem_array(10, sizeof *mesh.name);
    for (size_t i = 0; i < 10; i++)
        mesh.name[i] = mem_strdup(i == 9 ? "lamp\n1" : "");
    segments_from_object_id(&segments, &mesh);
    CHECK(atlas_make(&atlas, &mesh, &segments, 64, 0.0f, ATLAS_PADDING, &err) == STATUS_OK);

    char path[] = "/tmp/unbake-test-ply-XXXXXX";
    int fd = mkstemp(path);
    CHECK(fd >= 0);
    close(fd);
    CHECK(mesh_ply_write(path, &mesh, &segments, &atlas, &err) == STATUS_OK);
    struct buf file;
    buf_init(&file, 1 << 20);
    CHECK(file_read(path, &file, &err) == STATUS_OK);
    CHECK(memmem(file.data, file.length, "\ncomment TextureFile base_color.png\n", 36) != NULL);
    CHECK(memmem(file.data, file.length, "\ncomment segment 1 lamp 1\n", 26) &&
          !strstr(file.data, "comment segment 0"));
    check_file(buf_text(&file), file.length, &mesh, &segments, &atlas);
    unlink(path);
    CHECK(mesh_ply_write("/nowhere/at/all.ply", &mesh, &segments, &atlas, &err) != STATUS_OK);
    CHECK(strstr(err.message, "/nowhere/at/all.ply"));
    buf_release(&file);
    atlas_release(&atlas);
    segments_release(&segments);
    mesh_release(&mesh);
    return check_result();
}
