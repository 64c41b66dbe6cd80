/* Tables of an estimator's fields, to write and read it as bytes; see fields.c. */
#ifndef TG_FIELDS_H
#define TG_FIELDS_H
#include "estimator.h"

typedef struct tgi_field {
    size_t offset, count, size;     /* in its structure; how many, and the size of one */
    const struct tgi_field *inside; /* of a structure: its own fields; null: numbers */
} tgi_field;

extern const tgi_field tgi_settings_fields[], tgi_estimator_fields[], tgi_filter_fields[], tgi_consider_fields[];
extern const tgi_field tgi_policy_fields[][3]; /* by tg_policy, of a tg_filter */
size_t tgi_fields_size(const tgi_field *fields);
uint8_t *tgi_write_fields(const tgi_field *fields, const void *object, uint8_t *bytes); /* returns the end */
const uint8_t *tgi_read_fields(const tgi_field *fields, void *object, const uint8_t *bytes);
#endif
