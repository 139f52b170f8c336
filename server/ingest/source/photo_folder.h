/* photo_folder.h -- where the photographs lie that a file of cameras names.
 *
 * Tools write names of all kinds: bare ("IMG_1.jpg"), relative to a folder that was since moved ("../in/IMG_1.jpg"),
 * absolute ("C:\\scan\\IMG_1.JPG"), without extension. Files match by folder, not one by one: all frames are looked for
 * in one folder, with the same number of leading parts of their names left out, so that a name that is missing is never
 * another folder's file of the same name (a depth map, a mask). */
#ifndef UNBAKE_INGEST_SOURCE_PHOTO_FOLDER_H
#define UNBAKE_INGEST_SOURCE_PHOTO_FOLDER_H

#include <stdbool.h>

#include "server/ingest/source/source.h"

/* Whether the name ends like a picture's that is read, or one of camera raw. */
bool photo_is_picture(const char *path);

/* Replaces the frames' names by paths from the root. Folders are tried in this order: `base` and the folders that tools
 * use below it (images/, photos/, rgb/, ...), then the same below each folder above; the one with most of the
 * photographs is taken. In a folder a name matches exactly, else but for case, else but for the extension (and then a
 * picture before camera raw); where it may mean two files, both are named as a problem. Names that are not found get
 * the base before them. Warns where the folder is not the one that the names say; with `tells_unposed` also of
 * photographs beside them that no frame names. Returns how many were found. */
size_t photo_folder_resolve(const struct listing *l, const char *base, bool tells_unposed, struct frames *t,
                            struct findings *f);

/* The same for the masks of frames that have one, in the folders that tools use for them; call it after
 * photo_folder_resolve, whose files are no masks. */
void photo_folder_settle_masks(const struct listing *l, const char *base, struct frames *t, struct findings *f);

#endif
