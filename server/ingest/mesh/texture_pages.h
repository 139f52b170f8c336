/* texture_pages.h -- tells pages of a texture from materials.
 *
 * Programs for photogrammetry divide a mesh by the picture that textures it (material_0000, material_0001: Polycam,
 * OpenMVS, ODM, RealityCapture). The borders between these pages run anywhere, and say nothing about materials.
 *
 * With the materials at hand: those in use, two at least, have a picture each and are equal but for it, and the
 * pictures are numbered. Else by name: one word for a material or texture and consecutive numbers. */
#ifndef UNBAKE_INGEST_MESH_TEXTURE_PAGES_H
#define UNBAKE_INGEST_MESH_TEXTURE_PAGES_H

#include <stdbool.h>
#include <stddef.h>

/* Whether the names are those of pages, as far as names tell. */
bool texture_pages_by_name(const char *const *name, size_t count);

/* Whether at least two names differ, and only in digits. */
bool texture_pages_are_numbered(const char *const *name, size_t count);

/* From an MTL file: text[length], any bytes. TEXTURE_PAGES_UNKNOWN when it does not have all materials. *picture_count:
 * distinct pictures of the materials' base colour. */
enum texture_pages { TEXTURE_PAGES_UNKNOWN, TEXTURE_PAGES_NO, TEXTURE_PAGES_YES };
enum texture_pages texture_pages_by_mtl(const char *text, size_t length, const char *const *material, size_t count,
                                        size_t *picture_count);

#endif
