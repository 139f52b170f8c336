/* room.c -- see room.h. The table of objects, their geometry and their textures. */
#include "server/demo/room.h"

#include <assert.h>
#include <string.h>

#include "server/demo/paint.h"

/* Metres; radiance 1 stands for an emitter, whose emission room_init sets. */
static const struct {
    const char *name;
    float roughness, specular;
} object[ROOM_OBJECT_COUNT] = {
    [ROOM_FLOOR] = {"floor", 0.45f, 0.5f},
    [ROOM_CEILING] = {"ceiling", 0.9f, 0.1f},
    [ROOM_WALL_WEST] = {"wall_west", 0.85f, 0.2f},
    [ROOM_WALL_EAST] = {"wall_east", 0.7f, 0.3f},
    [ROOM_WALL_NORTH] = {"wall_north", 0.85f, 0.2f},
    [ROOM_WALL_SOUTH] = {"wall_south", 0.8f, 0.3f},
    [ROOM_CARPET] = {"carpet", 1.0f, 0.0f},
    [ROOM_TABLE_TOP] = {"table_top", 0.3f, 0.5f},
    [ROOM_TABLE_LEGS] = {"table_legs", 0.6f, 0.4f},
    [ROOM_DOOR] = {"door", 0.5f, 0.5f},
    [ROOM_DOOR_FRAME] = {"door_frame", 0.5f, 0.5f},
    [ROOM_SHELVES] = {"shelves", 0.55f, 0.4f},
    [ROOM_BOOKS] = {"books", 0.6f, 0.4f},
    [ROOM_GLOBE] = {"globe", 0.25f, 0.6f},
    [ROOM_CHEST] = {"chest", 0.4f, 0.5f},
    [ROOM_VASE] = {"vase", 0.2f, 0.8f},
    [ROOM_PAINTING_LARGE] = {"painting_large", 0.7f, 0.3f},
    [ROOM_PAINTING_SMALL] = {"painting_small", 0.7f, 0.3f},
    [ROOM_PICTURE_FRAMES] = {"picture_frames", 0.35f, 0.7f},
    [ROOM_SOFA] = {"sofa", 0.95f, 0.1f},
    [ROOM_LAMP_FRAMES] = {"lamp_frames", 0.6f, 0.4f},
    [ROOM_WALL_EMITTER] = {"wall_emitter", 0.9f, 0.1f},
    [ROOM_CEILING_EMITTER] = {"ceiling_emitter", 0.9f, 0.1f},
};

static const vec3 obstacle[][2] = {
    {{1.65f, 0.0f, 1.45f}, {3.15f, 1.2f, 2.35f}}, /* table and vase */
    {{3.15f, 0.0f, 0.0f}, {4.85f, 2.0f, 0.35f}},  /* shelves */
    {{4.1f, 0.0f, 1.5f}, {5.0f, 0.9f, 3.4f}},     /* sofa */
    {{2.0f, 2.65f, 1.5f}, {3.0f, 2.8f, 2.5f}},    /* ceiling lamp */
};

const char *room_object_name(enum room_object o) { return object[o].name; }

const vec3 (*room_obstacles(size_t *count))[2] {
    *count = sizeof obstacle / sizeof *obstacle;
    return obstacle;
}

/* --- where things stand ------------------------------------------------------------------- */

static void box(struct shapes *s, enum room_object o, float x0, float y0, float z0, float x1, float y1, float z1,
                int without) {
    shapes_box(s, o, vec3_make(x0, y0, z0), vec3_make(x1, y1, z1), without);
}

/* The emitter on the west wall, metres. */
#define PANEL_BOTTOM 1.1f
#define PANEL_TOP 2.0f
#define PANEL_BACK 1.4f
#define PANEL_FRONT 2.6f
#define WALL_FRAME 0.06f /* width of its frame */
/* The one at the ceiling. */
#define CEILING_LAMP_LEFT 2.1f
#define CEILING_LAMP_RIGHT 2.9f
#define CEILING_LAMP_BACK 1.6f
#define CEILING_LAMP_FRONT 2.4f
#define CEILING_FRAME 0.05f

static void add_wall(struct shapes *s, enum room_object o, int face, float y0, float z0, float y1, float z1) {
    box(s, o, 0.0f, y0, z0, ROOM_WIDTH, y1, z1, (63 & ~face) | SHAPE_INWARD);
}

/* Wall, frame and emitter in one plane; corners counter-clockwise seen from inside. */
static void add_flush_lamp(struct shapes *s, enum room_object around, enum room_object emitter, const vec3 side[4],
                           const vec3 frame[4], const vec3 panel[4]) {
    shapes_plane_with_hole(s, around, side, frame);
    shapes_plane_with_hole(s, ROOM_LAMP_FRAMES, frame, panel);
    shapes_plane(s, emitter, panel);
}

/* The rectangle at x = 0 that looks to +x. */
static void on_west_wall(float y0, float z0, float y1, float z1, vec3 corner[4]) {
    const vec3 c[4] = {{0.0f, y0, z0}, {0.0f, y1, z0}, {0.0f, y1, z1}, {0.0f, y0, z1}};
    memcpy(corner, c, sizeof c);
}

/* That at the ceiling, which looks down. */
static void on_ceiling(float x0, float z0, float x1, float z1, vec3 corner[4]) {
    const vec3 c[4] = {{x0, ROOM_HEIGHT, z0}, {x1, ROOM_HEIGHT, z0}, {x1, ROOM_HEIGHT, z1}, {x0, ROOM_HEIGHT, z1}};
    memcpy(corner, c, sizeof c);
}

static void add_flush_lamps(struct shapes *s) {
    const float wall = WALL_FRAME, ceiling = CEILING_FRAME;
    vec3 side[4], frame[4], panel[4];
    on_west_wall(0.0f, 0.0f, ROOM_HEIGHT, ROOM_DEPTH, side);
    on_west_wall(PANEL_BOTTOM - wall, PANEL_BACK - wall, PANEL_TOP + wall, PANEL_FRONT + wall, frame);
    on_west_wall(PANEL_BOTTOM, PANEL_BACK, PANEL_TOP, PANEL_FRONT, panel);
    add_flush_lamp(s, ROOM_WALL_WEST, ROOM_WALL_EMITTER, side, frame, panel);
    on_ceiling(0.0f, 0.0f, ROOM_WIDTH, ROOM_DEPTH, side);
    on_ceiling(CEILING_LAMP_LEFT - ceiling, CEILING_LAMP_BACK - ceiling, CEILING_LAMP_RIGHT + ceiling,
               CEILING_LAMP_FRONT + ceiling, frame);
    on_ceiling(CEILING_LAMP_LEFT, CEILING_LAMP_BACK, CEILING_LAMP_RIGHT, CEILING_LAMP_FRONT, panel);
    add_flush_lamp(s, ROOM_CEILING, ROOM_CEILING_EMITTER, side, frame, panel);
}

static void add_shell(struct shapes *s, enum room_lamps lamps) {
    static const struct {
        enum room_object o;
        int face;
    } side[6] = {
        {ROOM_WALL_WEST, SHAPE_LEFT}, {ROOM_WALL_EAST, SHAPE_RIGHT}, {ROOM_FLOOR, SHAPE_BOTTOM},
        {ROOM_CEILING, SHAPE_TOP},    {ROOM_WALL_NORTH, SHAPE_BACK}, {ROOM_WALL_SOUTH, SHAPE_FRONT},
    };
    for (int i = 0; i < 6; i++) {
        bool has_hole = (side[i].o == ROOM_WALL_WEST && lamps != ROOM_LAMPS_FRAMED) ||
                        (side[i].o == ROOM_CEILING && lamps == ROOM_LAMPS_FLUSH);
        if (!has_hole)
            add_wall(s, side[i].o, side[i].face, 0.0f, 0.0f, ROOM_HEIGHT, ROOM_DEPTH);
    }
    if (lamps == ROOM_LAMPS_FLUSH)
        add_flush_lamps(s);
    if (lamps != ROOM_LAMPS_OPENING)
        return;
    add_wall(s, ROOM_WALL_WEST, SHAPE_LEFT, 0.0f, 0.0f, PANEL_BOTTOM, ROOM_DEPTH);
    add_wall(s, ROOM_WALL_WEST, SHAPE_LEFT, PANEL_TOP, 0.0f, ROOM_HEIGHT, ROOM_DEPTH);
    add_wall(s, ROOM_WALL_WEST, SHAPE_LEFT, PANEL_BOTTOM, 0.0f, PANEL_TOP, PANEL_BACK);
    add_wall(s, ROOM_WALL_WEST, SHAPE_LEFT, PANEL_BOTTOM, PANEL_FRONT, PANEL_TOP, ROOM_DEPTH);
}

static void add_table(struct shapes *s) {
    const float x[2] = {1.76f, 2.98f}, z[2] = {1.56f, 2.18f}, wide = 0.06f;
    box(s, ROOM_CARPET, 1.0f, 0.0f, 0.9f, 3.8f, 0.012f, 3.1f, SHAPE_BOTTOM);
    box(s, ROOM_TABLE_TOP, 1.7f, 0.71f, 1.5f, 3.1f, 0.75f, 2.3f, 0);
    for (int i = 0; i < 4; i++) {
        float left = x[i & 1], back = z[i >> 1];
        box(s, ROOM_TABLE_LEGS, left, 0.012f, back, left + wide, 0.71f, back + wide, SHAPE_BOTTOM | SHAPE_TOP);
    }
    static const vec2 vase[] = {
        {0.0f, 0.0f},    {0.060f, 0.0f},  {0.070f, 0.01f}, {0.090f, 0.05f}, {0.112f, 0.11f}, {0.118f, 0.17f},
        {0.106f, 0.23f}, {0.078f, 0.28f}, {0.052f, 0.32f}, {0.046f, 0.35f}, {0.056f, 0.38f}, {0.070f, 0.40f},
    };
    shapes_lathe(s, ROOM_VASE, vec3_make(2.12f, 0.75f, 1.84f), vase, sizeof vase / sizeof *vase, 40);
}

static void add_door(struct shapes *s) {
    const float back = ROOM_DEPTH, left = 3.5f, right = 4.35f, top = 2.05f, wide = 0.08f;
    box(s, ROOM_DOOR, left, 0.0f, back - 0.04f, right, top, back, SHAPE_FRONT | SHAPE_BOTTOM);
    for (int i = 0; i < 2; i++) {
        float low = i ? 1.12f : 0.2f, high = i ? 1.88f : 0.92f;
        box(s, ROOM_DOOR, left + 0.14f, low, back - 0.06f, right - 0.14f, high, back - 0.04f, SHAPE_FRONT);
    }
    box(s, ROOM_DOOR_FRAME, left - wide, 0.0f, back - 0.07f, left, top + wide, back, SHAPE_FRONT | SHAPE_BOTTOM);
    box(s, ROOM_DOOR_FRAME, right, 0.0f, back - 0.07f, right + wide, top + wide, back, SHAPE_FRONT | SHAPE_BOTTOM);
    box(s, ROOM_DOOR_FRAME, left, top, back - 0.07f, right, top + wide, back, SHAPE_FRONT | SHAPE_LEFT | SHAPE_RIGHT);
}

static void add_shelves(struct shapes *s) {
    const float left = 3.2f, right = 4.8f, deep = 0.3f, thick = 0.03f;
    static const float board[] = {0.35f, 0.85f, 1.35f, 1.9f};
    box(s, ROOM_SHELVES, left, 0.0f, 0.0f, left + thick, 1.93f, deep, SHAPE_BACK | SHAPE_BOTTOM);
    box(s, ROOM_SHELVES, right - thick, 0.0f, 0.0f, right, 1.93f, deep, SHAPE_BACK | SHAPE_BOTTOM);
    for (int i = 0; i < 4; i++)
        box(s, ROOM_SHELVES, left + thick, board[i], 0.0f, right - thick, board[i] + thick, deep - 0.01f,
            SHAPE_BACK | SHAPE_LEFT | SHAPE_RIGHT);
    float x = 3.3f;
    for (int i = 0; i < 9; i++) {
        float wide = 0.045f + 0.012f * (float)(i * 7 % 4), high = 0.24f + 0.03f * (float)(i * 5 % 4);
        box(s, ROOM_BOOKS, x, 0.88f, 0.03f, x + wide, 0.88f + high, 0.24f, SHAPE_BOTTOM);
        x += wide + 0.002f;
    }
    static const vec2 globe[] = {
        {0.0f, 0.0f},     {0.050f, 0.0f},   {0.052f, 0.02f},  {0.018f, 0.03f}, {0.016f, 0.06f},
        {0.062f, 0.076f}, {0.106f, 0.114f}, {0.127f, 0.162f}, {0.130f, 0.19f}, {0.127f, 0.218f},
        {0.106f, 0.266f}, {0.062f, 0.304f}, {0.0f, 0.32f},
    };
    shapes_lathe(s, ROOM_GLOBE, vec3_make(4.3f, 1.38f, 0.15f), globe, sizeof globe / sizeof *globe, 32);
    box(s, ROOM_CHEST, 3.5f, 1.38f, 0.04f, 3.9f, 1.62f, 0.26f, SHAPE_BOTTOM);
    box(s, ROOM_CHEST, 4.0f, 0.38f, 0.04f, 4.5f, 0.68f, 0.27f, SHAPE_BOTTOM);
}

/* A rectangular frame of width `wide` around the panel from `lower` to `upper` in the plane of axes u and v;
 * `without` omits the side on the wall. */
static void add_frame(struct shapes *s, enum room_object o, vec3 lower, vec3 upper, vec3 u, vec3 v, float wide,
                      int without) {
    vec3 span = vec3_sub(upper, lower);
    float across = vec3_dot(span, u), along = vec3_dot(span, v);
    vec3 deep = vec3_sub(vec3_sub(span, vec3_scale(u, across)), vec3_scale(v, along));
    const struct {
        float u, v, width, height;
    } bar[4] = {
        {-wide, -wide, across + 2.0f * wide, wide},
        {-wide, along, across + 2.0f * wide, wide},
        {-wide, 0.0f, wide, along},
        {across, 0.0f, wide, along},
    };
    for (int i = 0; i < 4; i++) {
        vec3 from = vec3_mad(vec3_mad(lower, bar[i].u, u), bar[i].v, v);
        vec3 to = vec3_add(vec3_mad(vec3_mad(from, bar[i].width, u), bar[i].height, v), deep);
        shapes_box(s, o, from, to, without);
    }
}

static void add_pictures(struct shapes *s) {
    const vec3 x = {1.0f, 0.0f, 0.0f}, y = {0.0f, 1.0f, 0.0f}, z = {0.0f, 0.0f, 1.0f};
    box(s, ROOM_PAINTING_LARGE, 0.8f, 1.05f, 0.0f, 2.4f, 2.05f, 0.02f, 63 & ~SHAPE_FRONT);
    add_frame(s, ROOM_PICTURE_FRAMES, vec3_make(0.8f, 1.05f, 0.0f), vec3_make(2.4f, 2.05f, 0.04f), x, y, 0.06f,
              SHAPE_BACK);
    box(s, ROOM_PAINTING_SMALL, ROOM_WIDTH - 0.02f, 1.25f, 0.6f, ROOM_WIDTH, 2.05f, 1.3f, 63 & ~SHAPE_LEFT);
    add_frame(s, ROOM_PICTURE_FRAMES, vec3_make(ROOM_WIDTH - 0.04f, 1.25f, 0.6f), vec3_make(ROOM_WIDTH, 2.05f, 1.3f), z,
              y, 0.05f, SHAPE_RIGHT);
}

static void add_sofa(struct shapes *s) {
    box(s, ROOM_SOFA, 4.15f, 0.0f, 1.7f, 4.95f, 0.42f, 3.2f, SHAPE_BOTTOM | SHAPE_BACK | SHAPE_FRONT);
    box(s, ROOM_SOFA, 4.72f, 0.42f, 1.7f, 4.95f, 0.85f, 3.2f, SHAPE_BOTTOM);
    box(s, ROOM_SOFA, 4.15f, 0.0f, 1.55f, 4.95f, 0.6f, 1.7f, SHAPE_BOTTOM);
    box(s, ROOM_SOFA, 4.15f, 0.0f, 3.2f, 4.95f, 0.6f, 3.35f, SHAPE_BOTTOM);
}

static void add_lamps(struct shapes *s) {
    const vec3 x = {1.0f, 0.0f, 0.0f}, y = {0.0f, 1.0f, 0.0f}, z = {0.0f, 0.0f, 1.0f};
    box(s, ROOM_WALL_EMITTER, 0.0f, PANEL_BOTTOM, PANEL_BACK, 0.03f, PANEL_TOP, PANEL_FRONT, 63 & ~SHAPE_RIGHT);
    add_frame(s, ROOM_LAMP_FRAMES, vec3_make(0.0f, PANEL_BOTTOM, PANEL_BACK), vec3_make(0.06f, PANEL_TOP, PANEL_FRONT),
              z, y, WALL_FRAME, SHAPE_LEFT);
    box(s, ROOM_CEILING_EMITTER, CEILING_LAMP_LEFT, 2.76f, CEILING_LAMP_BACK, CEILING_LAMP_RIGHT, ROOM_HEIGHT,
        CEILING_LAMP_FRONT, 63 & ~SHAPE_BOTTOM);
    add_frame(s, ROOM_LAMP_FRAMES, vec3_make(CEILING_LAMP_LEFT, 2.73f, CEILING_LAMP_BACK),
              vec3_make(CEILING_LAMP_RIGHT, ROOM_HEIGHT, CEILING_LAMP_FRONT), x, z, CEILING_FRAME, SHAPE_TOP);
}

/* --- textures ----------------------------------------------------------------------------- */

struct painting {
    struct room *room;
};

/* One row of the texture: the mean of four samples per valid texel. */
static void paint_row(void *user, size_t y, int thread) {
    static const float place[4][2] = {{0.125f, 0.375f}, {0.625f, 0.125f}, {0.375f, 0.875f}, {0.875f, 0.625f}};
    struct room *room = ((struct painting *)user)->room;
    struct texture *texture = &room->materials.base_color;
    (void)thread;
    for (uint32_t x = 0; x < texture->width; x++) {
        size_t texel = y * texture->width + x;
        if (room->inverse.triangle[texel] == INVERSE_UV_NONE)
            continue;
        rgb sum = {0.0f, 0.0f, 0.0f};
        for (int i = 0; i < 4; i++) {
            uint32_t t;
            float b1, b2;
            bool valid = inverse_uv_lookup(&room->inverse, &room->atlas, (float)x + place[i][0], (float)y + place[i][1],
                                           &t, &b1, &b2);
            assert(valid);
            (void)valid;
            const uint32_t *v = room->mesh.index[t];
            vec3 a = room->mesh.position[v[0]];
            vec3 p = vec3_mad(vec3_mad(a, b1, vec3_sub(room->mesh.position[v[1]], a)), b2,
                              vec3_sub(room->mesh.position[v[2]], a));
            sum = rgb_add(sum, paint_base_color((enum room_object)room->mesh.object_id[t], p,
                                                vec3_normalize(mesh_cross(&room->mesh, t))));
        }
        texture->texel[texel][0] = 0.25f * sum.r;
        texture->texel[texel][1] = 0.25f * sum.g;
        texture->texel[texel][2] = 0.25f * sum.b;
    }
}

static void make_materials(struct room *room, const struct room_look *look, struct parallel *pool) {
    materials_init(&room->materials, &room->inverse, room->segments.count, rgb_gray(0.5f), 0.5f, 0.5f);
    for (size_t i = 0; i < ROOM_OBJECT_COUNT; i++) {
        room->materials.roughness[i] = object[i].roughness;
        room->materials.specular[i] = object[i].specular;
    }
    /* The ceiling lamp is warm, the wall emitter daylight. */
    room->materials.emission[ROOM_WALL_EMITTER] = rgb_scale(rgb_make(0.92f, 1.0f, 1.08f), look->wall_radiance);
    room->materials.emission[ROOM_CEILING_EMITTER] = rgb_scale(rgb_make(1.1f, 1.0f, 0.85f), look->ceiling_radiance);
    struct painting painting = {room};
    parallel_for(pool, room->atlas.height, paint_row, &painting);
}

enum status room_init(struct room *room, const struct room_look *look, struct parallel *pool, struct error *err) {
    struct shapes s;
    struct mesh_report report;
    memset(room, 0, sizeof *room);
    shapes_init(&s);
    add_shell(&s, look->lamps);
    add_table(&s);
    add_door(&s);
    add_shelves(&s);
    add_pictures(&s);
    add_sofa(&s);
    if (look->lamps != ROOM_LAMPS_FLUSH)
        add_lamps(&s);
    room->mesh = s.mesh;
    enum status status = mesh_check(&room->mesh, "the demo room", &report, err);
    if (status != STATUS_OK)
        goto out;
    assert(report.degenerate_count == 0 && report.duplicate_count == 0);
    segments_from_object_id(&room->segments, &room->mesh);
    assert(room->segments.count == ROOM_OBJECT_COUNT);
    status = atlas_make(&room->atlas, &room->mesh, &room->segments, look->texture_size, 0.0f, ATLAS_PADDING, err);
    if (status != STATUS_OK)
        goto out;
    inverse_uv_make(&room->inverse, &room->atlas, room->mesh.triangle_count, pool);
    make_materials(room, look, pool);
    status = world_init(&room->world, &room->mesh, &room->segments, &room->atlas, &room->materials, NULL, pool, err);
out:
    if (status != STATUS_OK)
        room_release(room);
    return status;
}

void room_release(struct room *room) {
    world_release(&room->world);
    materials_release(&room->materials);
    inverse_uv_release(&room->inverse);
    atlas_release(&room->atlas);
    segments_release(&room->segments);
    mesh_release(&room->mesh);
    memset(room, 0, sizeof *room);
}
