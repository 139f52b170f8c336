/* exif.c -- the few EXIF fields that a reconstruction needs (CIPA DC-008, Exif 2.32, a TIFF
 * structure: sections 4.5 and 4.6.2). Every offset is checked against the block's size; both
 * byte orders; no field is required. Only IFD0, the Exif IFD it points to and the interoperability
 * IFD that one points to are read, so there are no chains to follow in circles. */
#include <string.h>

#include "common/image_codec.h"

enum {
    TAG_ORIENTATION = 0x0112,
    TAG_EXIF_IFD = 0x8769,
    TAG_COLOR_SPACE = 0xa001, /* 1: sRGB, 65535: uncalibrated; some cameras have 2 for Adobe RGB */
    TAG_INTEROPERABILITY_IFD = 0xa005,
    TAG_INTEROPERABILITY_INDEX = 0x0001,
    TAG_EXPOSURE_TIME = 0x829a,
    TAG_F_NUMBER = 0x829d,
    TAG_SENSITIVITY = 0x8827, /* PhotographicSensitivity; 65535 when it does not fit */
    TAG_ISO_SPEED = 0x8833,   /* ISOSpeed, a LONG */
    TAG_STANDARD_SENSITIVITY = 0x8831,
    TAG_RECOMMENDED_INDEX = 0x8832
};
enum { TYPE_ASCII = 2, TYPE_SHORT = 3, TYPE_LONG = 4, TYPE_RATIONAL = 5 };

struct block {
    const uint8_t *data;
    size_t size;
    bool big_endian;
};

/* The unsigned integer of `bytes` (2 or 4) at `offset`; 0 when it is not inside. */
static uint32_t integer_at(const struct block *b, size_t offset, size_t bytes) {
    if (offset > b->size || bytes > b->size - offset)
        return 0;
    uint32_t value = 0;
    for (size_t i = 0; i < bytes; i++)
        value = value << 8 | b->data[offset + (b->big_endian ? i : bytes - 1 - i)];
    return value;
}

/* The first value of the directory entry at `entry`, 0 when its type is none of ours. */
static double entry_value(const struct block *b, size_t entry) {
    uint32_t type = integer_at(b, entry + 2, 2), count = integer_at(b, entry + 4, 4);
    if (count == 0)
        return 0;
    if (type == TYPE_SHORT && count <= 2)
        return integer_at(b, entry + 8, 2);
    if (type == TYPE_SHORT)
        return integer_at(b, integer_at(b, entry + 8, 4), 2);
    if (type == TYPE_LONG && count == 1)
        return integer_at(b, entry + 8, 4);
    if (type != TYPE_RATIONAL)
        return 0;
    size_t place = integer_at(b, entry + 8, 4);
    uint32_t denominator = integer_at(b, place + 4, 4);
    return denominator == 0 ? 0 : (double)integer_at(b, place, 4) / denominator;
}

/* Values of the sensitivity tags, in order of preference. */
struct sensitivity {
    double photographic, iso_speed, standard, recommended;
};

/* Whether the directory's InteroperabilityIndex is "R03": the picture is of Adobe RGB (DCF 2.0). */
static bool says_adobe_rgb(const struct block *b, size_t offset) {
    size_t count = integer_at(b, offset, 2);
    for (size_t i = 0; i < count; i++) {
        size_t entry = offset + 2 + 12 * i;
        if (entry > b->size || b->size - entry < 12)
            return false;
        if (integer_at(b, entry, 2) == TAG_INTEROPERABILITY_INDEX && integer_at(b, entry + 2, 2) == TYPE_ASCII)
            return memcmp(b->data + entry + 8, "R03", 4) == 0;
    }
    return false;
}

/* Offsets found in a directory. */
struct next {
    size_t exif, interoperability; /* offsets; 0: none */
};

/* Reads one directory. */
static struct next read_directory(const struct block *b, size_t offset, struct image_info *info,
                                  struct sensitivity *iso) {
    struct next next = {0, 0};
    size_t count = integer_at(b, offset, 2);
    for (size_t i = 0; i < count; i++) {
        size_t entry = offset + 2 + 12 * i;
        if (entry > b->size || b->size - entry < 12)
            break;
        double value = entry_value(b, entry);
        if (!(value > 0))
            continue;
        switch (integer_at(b, entry, 2)) {
        case TAG_ORIENTATION:
            if (value >= 1 && value <= 8) /* a rational may lie below 1 */
                info->orientation = (int)value;
            break;
        case TAG_EXIF_IFD: next.exif = (size_t)value; break;
        case TAG_INTEROPERABILITY_IFD: next.interoperability = (size_t)value; break;
        case TAG_COLOR_SPACE:
            info->is_uncalibrated = value == 65535;
            info->is_adobe_rgb = value == 2;
            break;
        case TAG_EXPOSURE_TIME: info->exposure_time_sec = value; break;
        case TAG_F_NUMBER: info->f_number = value; break;
        case TAG_SENSITIVITY: iso->photographic = value < 65535 ? value : 0; break;
        case TAG_ISO_SPEED: iso->iso_speed = value; break;
        case TAG_STANDARD_SENSITIVITY: iso->standard = value; break;
        case TAG_RECOMMENDED_INDEX: iso->recommended = value; break;
        default: break;
        }
    }
    return next;
}

void image_parse_exif(const uint8_t *data, size_t size, struct image_info *info) {
    if (size < 8)
        return;
    struct block b = {.data = data, .size = size, .big_endian = data[0] == 'M'};
    bool named = (data[0] == 'M' && data[1] == 'M') || (data[0] == 'I' && data[1] == 'I');
    if (!named || integer_at(&b, 2, 2) != 42)
        return;
    struct sensitivity iso = {0};
    struct next first = read_directory(&b, integer_at(&b, 4, 4), info, &iso), second = {0, 0};
    if (first.exif != 0)
        second = read_directory(&b, first.exif, info, &iso);
    if (second.interoperability != 0)
        info->is_adobe_rgb = info->is_adobe_rgb || says_adobe_rgb(&b, second.interoperability);
    info->iso = iso.photographic > 0 ? iso.photographic
                : iso.iso_speed > 0  ? iso.iso_speed
                : iso.standard > 0   ? iso.standard
                                     : iso.recommended;
}
