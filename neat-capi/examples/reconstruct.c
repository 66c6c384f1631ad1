/* reconstruct SCENE OUT: the wireframe of a scene, as lines of text.
 *
 *     cc examples/reconstruct.c -I include -L LIBRARIES -lneat_capi -o reconstruct
 */
#include "neat.h"

#include <stdio.h>
#include <string.h>

/* Progress and warnings; a run whose listener answers 1 ends. */
static int32_t listen(void *data, const NeatEvent *event) {
    const int32_t *cancel = data;
    if (event->kind == NEAT_EVENT_STAGE) {
        fprintf(stderr, "%s\n", event->text);
    } else if (event->kind == NEAT_EVENT_WARNING) {
        fprintf(stderr, "warning: %s\n", event->text);
    }
    return *cancel;
}

int main(int argc, char **argv) {
    if (argc < 3) {
        fprintf(stderr, "usage: %s SCENE OUT [cancel]\n", argv[0]);
        return NEAT_STATUS_BAD_INPUT;
    }
    int32_t cancel = argc > 3 && strcmp(argv[3], "cancel") == 0;
    NeatOptions options = {
        .size = sizeof options,
        .scene = argv[1],
        .out = argv[2],
        .listener = listen,
        .listener_data = &cancel,
    };
    NeatWireframe *wireframe = NULL;
    char *error = NULL;
    NeatStatus status = neat_reconstruct(&options, &wireframe, &error);
    if (status != NEAT_STATUS_OK) {
        fprintf(stderr, "neat %s: %s\n", neat_version(), error);
        neat_string_free(error);
        return (int)status;
    }

    NeatView view = {.size = sizeof view};
    neat_wireframe_view(wireframe, &view);
    for (size_t i = 0; i < view.junction_count; i++) {
        const double *x = view.junctions + 3 * i;
        printf("v %.17g %.17g %.17g\n", x[0], x[1], x[2]);
    }
    for (size_t i = 0; i < view.edge_count; i++) {
        const uint32_t *ends = view.edges + 2 * i;
        double probability = view.probabilities ? view.probabilities[i] : 1.0;
        printf("l %u %u %.17g\n", ends[0], ends[1], probability);
    }
    neat_wireframe_free(wireframe);
    return 0;
}
