/* xml.h -- a small XML file as a tree, over Expat. Namespaces are left as prefixes ("xcr:Rotation"); comments,
 * processing instructions and white space around text are dropped. */
#ifndef UNBAKE_INGEST_SOURCE_XML_H
#define UNBAKE_INGEST_SOURCE_XML_H

#include <stddef.h>

#include "common/error.h"

#define XML_MAX_DEPTH 64         /* of elements in each other */
#define XML_MAX_BYTES (64 << 20) /* thousands of cameras take a few */

struct xml_node {
    char *name;
    char **attribute; /* name, value, name, value, ..., NULL; owned */
    char *text;       /* [text_length] all of its own text, with a NUL; never NULL */
    size_t text_length;
    struct xml_node *parent, *first, *last, *next;
};

/* Parses text[size]; `name` is for messages. The root element is the caller's (xml_free). STATUS_INPUT with the
 * line. */
enum status xml_parse(const char *text, size_t size, const char *name, struct xml_node **root, struct error *err);
void xml_free(struct xml_node *node); /* NULL is fine */

const char *xml_library_version(void); /* "expat_2.5.0" */

/* The first child of that name, or the next one after `after`; NULL: none. `node` may be NULL. */
struct xml_node *xml_child(const struct xml_node *node, const char *name);
struct xml_node *xml_next(const struct xml_node *after, const char *name);
/* The first element of that name at or below `node`, in the order of the file; NULL: none. */
struct xml_node *xml_find(struct xml_node *node, const char *name);
/* Value of an attribute; NULL: absent. */
const char *xml_attribute(const struct xml_node *node, const char *name);

#endif
