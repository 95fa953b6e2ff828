#include "{{ name }}.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#ifdef {{ name | upper }}_SINGLE
#define TOLERANCE {{ parcel.single_tolerance }}
#else
#define TOLERANCE {{ parcel.tolerance }}
#endif

/* Runs the samples of a CSV file, whose first row is the start, and compares the outputs with friso's. */
int main(int count, char **words)
{
    {{ name }}_parameters parameters;
    {{ name }}_state state;
    double row[{{ inputs | length + 1 }}], worst = 0.0, largest = 0.0;
    long samples = -1;
    char line[4096];
    FILE *file = count == 2 ? fopen(words[1], "r") : NULL;
    if (file == NULL || fgets(line, sizeof line, file) == NULL) {
        fprintf(stderr, "usage: {{ name }}_test {{ name }}_vector.csv\n");
        return 2;
    }
    {{ name }}_defaults(&parameters);
    while (fgets(line, sizeof line, file) != NULL) {
        char *place = line;
        int k;
        for (k = 0; k < {{ inputs | length + 1 }}; k++) {
            row[k] = strtod(place, &place);
            place += *place == ',';
        }
        if (samples < 0) {
            {{ name }}_init(&state, &parameters, {% for k in range(inputs | length) %}row[{{ k }}], {% endfor %}row[{{ inputs | length + 1 }} - 1]);
        } else {
            double output = (double){{ name }}_step(&state{% for k in range(inputs | length) %}, ({{ real }})row[{{ k }}]{% endfor %});
            worst = fmax(worst, fabs(output - row[{{ inputs | length + 1 }} - 1]));
            largest = fmax(largest, fabs(row[{{ inputs | length + 1 }} - 1]));
        }
        samples++;
    }
    fclose(file);
    printf("%ld samples, largest difference %.3g of %.3g, %lu dropped\n", samples, worst, largest, state.dropped);
    return samples > 0 && worst <= TOLERANCE && state.dropped == 0 ? 0 : 1;
}
