{% include "about_machine" %}
#include "{{ name }}_machine.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

/* Runs the outputs of a CSV file through the machine, and compares its positions with friso's run of the same steps. */
int main(int count, char **words)
{
    {{ name }}_machine_parameters parameters;
    {{ name }}_machine machine;
    double worst = 0.0;
    long samples = -1;
    char line[4096];
    FILE *file = count == 2 ? fopen(words[1], "r") : NULL;
    if (file == NULL || fgets(line, sizeof line, file) == NULL) {
        fprintf(stderr, "usage: {{ name }}_machine_test {{ name }}_machine_vector.csv\n");
        return 2;
    }
    {{ name }}_machine_defaults(&parameters);
    while (fgets(line, sizeof line, file) != NULL) {
        char *place = line;
        double output = strtod(place, &place), position = strtod(place + 1, NULL);
        if (samples < 0) {
            {{ name }}_machine_init(&machine, &parameters, position, output, {{ run.steps }});
        } else {
            worst = fmax(worst, fabs({{ name }}_machine_position(&machine) - position));
            {{ name }}_machine_step(&machine, output);
        }
        samples++;
    }
    fclose(file);
    printf("%ld samples, largest difference %.3g\n", samples, worst);
    return samples > 0 && worst <= {{ run.tolerance }} ? 0 : 1;
}
