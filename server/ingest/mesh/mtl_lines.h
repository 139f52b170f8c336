/* mtl_lines.h -- the lines of a material library (.mtl). */
#ifndef UNBAKE_INGEST_MESH_MTL_LINES_H
#define UNBAKE_INGEST_MESH_MTL_LINES_H

/* The next line from *text on without blanks around it, and *text after it; lines end with LF, CR or both. NULL at
 * `end`. The caller's (mem_free). */
char *mtl_next_line(const char **text, const char *end);

#endif
