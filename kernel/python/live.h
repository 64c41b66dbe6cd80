/* What live samples need beside the kernel: JSON in and out. Bound for Python only; a controller has no text. */
#ifndef TG_LIVE_H
#define TG_LIVE_H

#include <stddef.h>

#include "terragrip.h"

/* cdef begin */
/* Write `head`, then of each column its name, with what stands around it and ended by a zero, and the number at its place among
 * `values`, the bytes of doubles: null where it is NaN or infinite; then the closing brace. `out` holds all that with 17 characters a
 * number; returns the length. */
size_t tg_json_row(const char *head, int32_t count, const char *names, const int32_t *places, const char *values, char *out);
/* Read a JSON number; returns where it ends. Null where none stands there, or one of more than 18 digits or an unusual exponent, or so
 * near the middle of two doubles that only long arithmetic tells which it is: then nothing is read. `text` ends with a zero. */
const char *tg_read_number(const char *text, double *value);

typedef struct { /* The way of samples that are as expected, from message to estimate */
    int32_t members;        /* of a message, the time among them */
    const char *keys;       /* "name" of each, in quotes, ended by a zero */
    const int32_t *slots;   /* of each: place in tg_sample.value, TG_EXPRESS_TIME (once), or TG_EXPRESS_OTHER: not the estimator's */
    double *rows;           /* room x (1 + members): of each row taken arrival, stamp and the others in their order */
    int32_t room, taken;    /* rows */
    double offset;          /* s: time = stamp + offset */
    double lead, jump;      /* s: of the last stamp to its arrival; the next may differ by `jump` */
    double released, calm;  /* s: a sample is later than the first, and not later than the second */
    double reach;           /* s that the next may be later, at most 1.5 of the last steps: the least that 1.5 periods may become */
    tg_sample *sample;      /* NaN in the slots that no member has */
    tg_estimate *estimate;
} tg_express;
enum { TG_EXPRESS_TIME = -1, TG_EXPRESS_OTHER = -2 };
/* Take a message, a JSON object of exactly these members in this order, zero-terminated, that arrived at `arrival` [s]. Returns 1 and
 * the estimate; or 0, with no row taken and the estimator as it was, where anything is not as expected, or there is no room. */
int32_t tg_express_take(tg_express *x, tg_estimator *e, const char *message, size_t size, double arrival);
/* cdef end */

extern const double TG_POWERS[23]; /* of ten: all that are doubles */

#endif
