/* Tables of an estimator's fields, to write and read it as bytes; see fields.c. */
#ifndef TG_FIELDS_H
#define TG_FIELDS_H
#include "estimator.h"

typedef struct tgi_field {
    size_t offset, count, size;     /* in its structure; how many, and the size of one */
    const struct tgi_field *inside; /* of a structure: its own fields; null: numbers */
    int32_t low, high;              /* of integers of the state: what they may be; of others 0 */
} tgi_field;

extern const tgi_field tgi_settings_fields[], tgi_estimator_fields[];
extern const tgi_field tgi_policy_fields[][3]; /* by tg_policy, of a tg_filter */
size_t tgi_fields_size(const tgi_field *fields);
uint8_t *tgi_write_fields(const tgi_field *fields, const void *object, uint8_t *bytes); /* returns the end */
int tgi_fields_are_sound(const tgi_field *fields, const uint8_t *bytes); /* whether every integer is within its range */
const uint8_t *tgi_read_fields(const tgi_field *fields, void *object, const uint8_t *bytes);
#endif
