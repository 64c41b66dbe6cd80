/* An estimate as a JSON object: for programs that send estimates as text, many a second. */
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "live.h"

static char *copied(char *out, const char *text, size_t length)
{
    memcpy(out, text, length);
    return out + length;
}

/* Nine digits, the last within half a unit and the rounding of a few products. Not by printf: 10 times slower, and a locale's comma. */
static char *number(char *out, double value)
{
    if (!isfinite(value))
        return copied(out, "null", 4);
    if (value < 0.0) {
        *out++ = '-';
        value = -value;
    }
    if (value == 0.0)
        return copied(out, "0", 1);
    int power = 0, binary; /* the value is `value` times ten to `power`; TG_POWERS are exact */
    for (; value < 1e-13; power -= 22)
        value *= 1e22;
    for (; value >= 1e22; power += 22)
        value /= 1e22;
    (void)frexp(value, &binary);
    int first = (int)floor(0.30102999566398120 * (binary - 1)); /* place of the first digit, or one too low */
    if (value >= (first + 1 >= 0 ? TG_POWERS[first + 1] : 1.0 / TG_POWERS[-first - 1]))
        first++;
    const double scaled = first <= 8 ? value * TG_POWERS[8 - first] : value / TG_POWERS[first - 8];
    uint32_t digits = (uint32_t)(scaled + 0.5);
    if (digits >= 1000000000u) {
        digits /= 10;
        first++;
    }
    char text[9];
    for (int k = 8; k >= 0; k--, digits /= 10)
        text[k] = (char)('0' + digits % 10);
    int length = 9;
    while (length > 1 && text[length - 1] == '0')
        length--;
    first += power;
    if (first < -5 || first > 8) { /* d.ddde-12 */
        *out++ = text[0];
        if (length > 1) {
            *out++ = '.';
            out = copied(out, text + 1, (size_t)length - 1);
        }
        *out++ = 'e';
        if (first < 0)
            *out++ = '-';
        const int size = first < 0 ? -first : first;
        if (size >= 100)
            *out++ = (char)('0' + size / 100);
        if (size >= 10)
            *out++ = (char)('0' + size / 10 % 10);
        *out++ = (char)('0' + size % 10);
        return out;
    }
    if (first < 0) { /* 0.00ddd */
        out = copied(out, "0.0000", (size_t)(1 - first));
        return copied(out, text, (size_t)length);
    }
    const int whole = first + 1; /* ddd000 or ddd.ddd */
    if (length <= whole) {
        out = copied(out, text, (size_t)length);
        return copied(out, "00000000", (size_t)(whole - length));
    }
    out = copied(out, text, (size_t)whole);
    *out++ = '.';
    return copied(out, text + whole, (size_t)(length - whole));
}

size_t tg_json_row(const char *head, int32_t count, const char *names, const int32_t *places, const char *values, char *out)
{
    char *end = copied(out, head, strlen(head));
    for (int32_t k = 0; k < count; k++) {
        const size_t length = strlen(names);
        double value;
        memcpy(&value, values + (size_t)places[k] * sizeof value, sizeof value); /* bytes need not be aligned */
        end = number(copied(end, names, length), value);
        names += length + 1;
    }
    *end++ = '}';
    return (size_t)(end - out);
}
