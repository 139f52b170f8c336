/* libraries.c -- see libraries.h. */
#include "server/libraries.h"

#include <archive.h>
#include <cjson/cJSON.h>
#include <string.h>

#include "common/buf.h"
#include "common/image.h"
#include "common/mem.h"
#include "server/ingest/mesh/gltf_meshopt.h"
#include "server/ingest/source/xml.h"
#include "server/net/tls.h"
#include "server/render/accel.h"
#include "server/store/store.h"
#include "server/transport/listener.h"

/* Some begin their version with their name. */
static struct library named(const char *name, const char *prefix, const char *version) {
    size_t length = strlen(prefix);
    return (struct library){name, strncmp(version, prefix, length) == 0 ? version + length : version};
}

void libraries_list(struct library list[LIBRARY_COUNT]) {
    list[0] = named("libmicrohttpd", "", listener_library_version());
    list[1] = named("sqlite", "", store_library_version());
    list[2] = named("embree", "Embree ", accel_library_version());
    list[3] = named("libarchive", "libarchive ", archive_version_string());
    list[4] = named("cjson", "", cJSON_Version());
    list[5] = named("libheif", "", image_heif_version());
    list[6] = named("meshoptimizer", "", gltf_meshopt_version());
    list[7] = named("libexpat", "expat_", xml_library_version());
    list[8] = named("gnutls", "", tls_library_version());
}

char *libraries_text(void) {
    struct library list[LIBRARY_COUNT];
    struct buf text;
    libraries_list(list);
    buf_init(&text, 4096);
    for (size_t i = 0; i < LIBRARY_COUNT; i++)
        buf_printf(&text, "%s%s %s", i ? ", " : "", list[i].name, list[i].version);
    char *copy = mem_strdup(buf_text(&text));
    buf_release(&text);
    return copy;
}

const char *libraries_lack(void) {
    return !archive_zlib_version()      ? "libarchive was built without zlib: no .zip or .tar.gz can be read"
           : !archive_libzstd_version() ? "libarchive was built without zstd: no .tar.zst can be read"
                                        : image_heif_lacks();
}
