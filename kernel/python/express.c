/* Samples as they are expected, nearly all of them, in one call from message to estimate: see live/express.py. */
#include <math.h>
#include <string.h>

#include "live.h"

static const char *behind_space(const char *text)
{
    while (*text == ' ' || *text == '\t' || *text == '\n' || *text == '\r')
        text++;
    return text;
}

/* Read the members' values into row and sample; null where the message is another. */
static const char *read_members(const tg_express *x, const char *text, double *row)
{
    double *next = row + 2;
    const char *key = x->keys;
    for (int32_t m = 0; m < x->members; m++) {
        text = behind_space(text);
        if (*text++ != (m ? ',' : '{'))
            return NULL;
        const size_t length = strlen(key);
        text = behind_space(text);
        if (strncmp(text, key, length) != 0)
            return NULL;
        key += length + 1;
        text = behind_space(text + length);
        if (*text++ != ':')
            return NULL;
        const int32_t slot = x->slots[m];
        double *value = slot == TG_EXPRESS_TIME ? row + 1 : next++;
        text = tg_read_number(behind_space(text), value);
        if (text == NULL)
            return NULL;
        if (slot >= 0)
            x->sample->value[slot] = (tg_real)*value;
    }
    text = behind_space(text);
    return *text == '}' ? behind_space(text + 1) : NULL;
}

int32_t tg_express_take(tg_express *x, tg_estimator *e, const char *message, size_t size, double arrival)
{
    if (x->taken >= x->room)
        return 0;
    double *row = x->rows + (size_t)x->taken * (size_t)(x->members + 1);
    if (read_members(x, message, row) != message + size)
        return 0;
    row[0] = arrival;
    const double stamp = row[1];
    const double lead = stamp - arrival, time = stamp + x->offset;
    if (!(fabs(lead - x->lead) <= x->jump && time > x->released && time <= x->calm))
        return 0;
    x->sample->time = time;
    if (tg_estimator_update(e, x->sample, x->estimate) != TG_OK)
        return 0;
    x->taken++;
    x->lead = lead;
    x->reach = fmin(x->reach, 1.5 * (time - x->released));
    x->released = time;
    x->calm = time + x->reach;
    return 1;
}
