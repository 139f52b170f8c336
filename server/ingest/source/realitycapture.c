/* realitycapture.c -- RealityCapture (RealityScan): "Internal/External camera parameters", a table of comma-separated
 * values with the header #name,x,y,alt,heading,pitch,roll,f,px,py,k1,k2,k3,k4,t1,t2, and XMP files beside the
 * photographs.
 *
 * In the table a camera with all angles 0 looks down (-z) with north (y) up; its rotation is Rz(-heading) Rx(pitch)
 * Ry(roll) with OpenGL's camera axes. f is a focal length of 35 mm film: f / 36 of the longer side; px and py likewise.
 * In XMP, xcr:Rotation turns the world into the camera, row-major, with our camera axes; xcr:Position is the camera's
 * centre; xcr:PrincipalPointU and V are shares of the longer side. xcr:DistortionModel "division" is Fitzgibbon's, of
 * coordinates in focal lengths; "brown3", "brown4" and those with "t2" are Brown's. The table does not say which model
 * its coefficients are of: Brown's have three at least, so that k1 alone is a division model's. z is up in both. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "common/mem.h"
#include "common/vec.h"
#include "server/ingest/path.h"
#include "server/ingest/source/frame_list.h"
#include "server/ingest/source/photo_folder.h"
#include "server/ingest/source/values.h"
#include "server/ingest/source/xml.h"

#define FILM_WIDTH_MM 36.0               /* focal lengths are stated for 35 mm film */
#define MAX_COLUMNS 64                   /* of its CSV */
#define MAX_CSV_BYTES ((size_t)64 << 20) /* of the file */

/* Focal length and principal point (from the centre) as shares of the picture's longer side, whose size is known only
 * when the picture is read; distortion k1 k2 k3 k4 t1 t2. */
static struct lens make_lens(double focal, double centre_x, double centre_y, const double distortion[6]) {
    struct lens lens = lens_pinhole(NAN, NAN, focal, focal, centre_x, centre_y);
    lens.is_relative = true;
    memcpy(lens.k, distortion, 3 * sizeof *distortion);
    lens.k8 = distortion[3];
    memcpy(lens.p, distortion + 4, 2 * sizeof *distortion);
    return lens;
}

/* --- the table -------------------------------------------------------------------------------- */

/* By its header: its name is the user's. */
static char *recognise_table(const struct listing *l, const char *base) {
    return listing_first_with(l, base, "*.csv", "#name", "heading");
}

/* Splits a line at commas, in place; a name in quotes loses them. */
static size_t split(char *line, char *cell[MAX_COLUMNS]) {
    size_t count = 0;
    for (char *at = line; at && count < MAX_COLUMNS;) {
        char *end = *at == '"' ? strchr(at + 1, '"') : NULL;
        if (end) {
            *end = '\0';
            cell[count++] = at + 1;
            at = strchr(end + 1, ',');
            at = at ? at + 1 : NULL;
        } else {
            cell[count++] = strsep(&at, ",");
        }
    }
    return count;
}

enum column { NAME, X, Y, ALT, HEADING, PITCH, ROLL, F, PX, PY, K1, K2, K3, K4, T1, T2, COLUMN_COUNT };

struct rc_columns {
    size_t place[COLUMN_COUNT]; /* of each column; MAX_COLUMNS: absent */
};

static enum status read_header(char *line, const char *name, struct rc_columns *table, struct error *err) {
    static const char *const names[COLUMN_COUNT] = {"#name", "x",  "y",  "alt", "heading", "pitch", "roll", "f",
                                                    "px",    "py", "k1", "k2",  "k3",      "k4",    "t1",   "t2"};
    char *cell[MAX_COLUMNS];
    size_t count = split(line, cell);
    for (int c = 0; c < COLUMN_COUNT; c++) {
        table->place[c] = MAX_COLUMNS;
        for (size_t i = 0; i < count; i++)
            if (strcasecmp(cell[i] + strspn(cell[i], " "), names[c]) == 0)
                table->place[c] = i;
        if (table->place[c] == MAX_COLUMNS && c <= F) {
            error_set(err, STATUS_INPUT, "%s has no column %s", name, names[c]);
            return error_hint(err, "export Registration as \"Internal/External camera parameters\"");
        }
    }
    return STATUS_OK;
}

/* Camera-to-world of heading, pitch and roll in degrees. */
static void rotate(const double degrees[3], double r[3][3]) {
    double a = -degrees[0] * PI / 180.0, b = degrees[1] * PI / 180.0, c = degrees[2] * PI / 180.0;
    double z[3][3] = {{cos(a), -sin(a), 0}, {sin(a), cos(a), 0}, {0, 0, 1}};
    double x[3][3] = {{1, 0, 0}, {0, cos(b), -sin(b)}, {0, sin(b), cos(b)}};
    double y[3][3] = {{cos(c), 0, sin(c)}, {0, 1, 0}, {-sin(c), 0, cos(c)}};
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            r[i][j] = 0.0;
            for (int p = 0; p < 9; p++)
                r[i][j] += z[i][p / 3] * x[p / 3][p % 3] * y[p % 3][j];
        }
}

static enum status read_row(char *line, size_t number, const struct rc_columns *table, struct frame_list *list,
                            size_t *division_count, struct error *err) {
    char *cell[MAX_COLUMNS], place[48];
    double v[COLUMN_COUNT] = {0.0}, r[3][3], m[3][4];
    size_t count = split(line, cell);
    for (int c = 0; c < COLUMN_COUNT; c++) {
        size_t at = table->place[c];
        bool is_given = at < count && (c == NAME || numbers_parse(cell[at], 1, &v[c]));
        if (!is_given && (c <= F || at < count))
            return error_set(err, STATUS_INPUT, "%s, line %zu: column %zu is no number", list->name, number, at + 1);
    }
    rotate(v + HEADING, r);
    for (int i = 0; i < 12; i++)
        m[i / 4][i % 4] = i % 4 < 3 ? r[i / 4][i % 4] : v[X + i / 4];
    struct lens lens = make_lens(v[F] / FILM_WIDTH_MM, v[PX] / FILM_WIDTH_MM, v[PY] / FILM_WIDTH_MM, v + K1);
    if (v[K1] != 0.0 && v[K2] == 0.0 && v[K3] == 0.0 && v[K4] == 0.0 && v[T1] == 0.0 && v[T2] == 0.0) {
        lens.model = CAMERA_DIVISION;
        (*division_count)++;
    }
    snprintf(place, sizeof place, "line %zu", number);
    return frame_list_add(list, m, &lens, cell[table->place[NAME]], place, NULL, err);
}

static enum status read_table(const struct source_place *place, struct frames *t, struct findings *f,
                              struct error *err) {
    struct frame_list list = frame_list_make(t, place->found, AXES_OPENGL, f);
    struct rc_columns table;
    struct error own;
    char *text, *line;
    enum status status = listing_text(place->listing, place->found, MAX_CSV_BYTES, &text, &own);
    const char *at = text ? text : "";
    bool has_header = false; /* "#cameras N" may come before it */
    size_t division_count = 0;
    for (size_t number = 1; status == STATUS_OK && (line = line_take(&at)) != NULL; number++) {
        char *header = has_header ? NULL : strstr(line, "#name");
        if (header) {
            status = read_header(header, place->found, &table, &own);
            has_header = true;
        } else if (has_header && line[strspn(line, " \t,")] != '\0') {
            status = read_row(line, number, &table, &list, &division_count, &own);
        }
        mem_free(line);
    }
    mem_free(text);
    if (division_count > 0)
        findings_warning(f,
                         "%s: %zu lenses have k1 alone and are taken for RealityCapture's division model, since its "
                         "Brown models have three coefficients; the XMP files say which it is",
                         place->found, division_count);
    photo_folder_resolve(place->listing, place->base, true, t, f);
    return findings_settle(f, place->found, status, &own, err);
}

const struct source source_realitycapture = {"RealityCapture", recognise_table, read_table};

/* --- XMP -------------------------------------------------------------------------------------- */

/* By the name space: other programs leave XMP files beside photographs, too. */
static char *recognise_xmp(const struct listing *l, const char *base) {
    static const char *const folders[] = {"", "images/", "photos/"};
    char *found = NULL;
    for (int i = 0; i < 3 && !found; i++) {
        char *pattern = mem_printf("%s*.xmp", folders[i]);
        found = listing_first_with(l, base, pattern, "rdf:", "xcr:");
        mem_free(pattern);
    }
    return found;
}

/* The text of an attribute of rdf:Description or an element in it; NULL: neither. */
static const char *text_of(struct xml_node *description, const char *name) {
    const char *attribute = xml_attribute(description, name);
    struct xml_node *child = xml_child(description, name);
    return attribute ? attribute : child ? child->text : NULL;
}

static bool take(struct xml_node *description, const char *name, size_t count, double *value) {
    const char *text = text_of(description, name);
    return text && numbers_parse(text, count, value);
}

/* STATUS_INPUT for what is not modelled. */
static enum status set_model(struct xml_node *d, const char *name, const double distortion[6], struct lens *lens,
                             struct error *err) {
    static const char *const brown[] = {"perspective", "brown3", "brown4", "brown3t2", "brown4t2"};
    const char *model = text_of(d, "xcr:DistortionModel");
    double skew = 0.0, aspect = 1.0;
    take(d, "xcr:Skew", 1, &skew);
    take(d, "xcr:AspectRatio", 1, &aspect);
    if (fabs(skew) > 1e-6 || fabs(aspect - 1.0) > 1e-6) {
        error_set(err, STATUS_INPUT, "%s: a lens with xcr:Skew %.6g and xcr:AspectRatio %.6g is not read", name, skew,
                  aspect);
        return error_hint(err, "export undistorted photographs with their cameras");
    }
    for (size_t i = 0; i < sizeof brown / sizeof *brown; i++)
        if (!model || strcasecmp(model, brown[i]) == 0)
            return STATUS_OK;
    if (strcasecmp(model, "division") != 0)
        error_set(err, STATUS_INPUT, "%s: the distortion model \"%.40s\" is not read", name, model);
    else if (distortion[1] != 0.0 || distortion[2] != 0.0 || distortion[3] != 0.0)
        error_set(err, STATUS_INPUT, "%s: the distortion model \"%.40s\" has more than one coefficient", name, model);
    else {
        lens->model = CAMERA_DIVISION;
        return STATUS_OK;
    }
    return error_hint(err, "set RealityCapture's distortion model to Brown3 and align again");
}

static enum status read_description(struct xml_node *d, const char *photograph, struct frame_list *list,
                                    size_t *unposed_count, struct error *err) {
    double r[3][3], centre[3], focal, u = 0.0, v = 0.0, distortion[6] = {0.0}, m[3][4];
    if (!take(d, "xcr:Rotation", 9, r[0]) || !take(d, "xcr:Position", 3, centre) ||
        !take(d, "xcr:FocalLength35mm", 1, &focal)) {
        (*unposed_count)++;
        return STATUS_OK;
    }
    take(d, "xcr:PrincipalPointU", 1, &u);
    take(d, "xcr:PrincipalPointV", 1, &v);
    take(d, "xcr:DistortionCoeficients", 6, distortion);
    struct lens lens = make_lens(focal / FILM_WIDTH_MM, u, v, distortion);
    enum status status = set_model(d, list->name, distortion, &lens, err);
    if (status != STATUS_OK)
        return status;
    pose_at_centre(r, centre, m);
    return frame_list_add(list, m, &lens, photograph, "xcr:Rotation", NULL, err);
}

/* One file; its faults are problems. */
static enum status read_xmp_file(const struct source_place *place, const char *path, struct frame_list *list,
                                 size_t *unposed_count, struct error *err) {
    struct mapping file;
    struct error own;
    struct xml_node *root = NULL;
    const char *name = path_base(path);
    char *photograph = mem_strndup(name, (size_t)(path_extension(name) - name) - 1);
    enum status status = listing_open(place->listing, path, "an XMP file", &file, &own);
    if (status == STATUS_OK)
        status = xml_parse(file.data, file.size, path, &root, &own);
    mapping_close(&file);
    list->name = path;
    if (status == STATUS_OK)
        status = read_description(xml_find(root, "rdf:Description"), photograph, list, unposed_count, &own);
    list->name = place->found;
    xml_free(root);
    mem_free(photograph);
    return findings_settle(list->findings, path, status, &own, err);
}

static enum status read_xmp(const struct source_place *place, struct frames *t, struct findings *f, struct error *err) {
    struct frame_list list = frame_list_make(t, place->found, AXES_OPENCV_INVERSE, f);
    struct error own;
    const struct listed_file *file;
    enum status status = STATUS_OK;
    size_t unposed_count = 0;
    char *folder = mem_strndup(place->found, (size_t)(path_base(place->found) - place->found));
    for (size_t at = 0; status == STATUS_OK && (file = listing_match(place->listing, folder, "*.xmp", &at)) != NULL;)
        status = read_xmp_file(place, file->path, &list, &unposed_count, &own);
    if (unposed_count > 0)
        findings_warning(f, "%zu files .xmp hold no pose of RealityCapture's; their photographs are not used",
                         unposed_count);
    photo_folder_resolve(place->listing, folder, false, t, f);
    mem_free(folder);
    return findings_settle(f, place->found, status, &own, err);
}

const struct source source_realitycapture_xmp = {"RealityCapture XMP", recognise_xmp, read_xmp};
