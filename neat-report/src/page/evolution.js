// The junctions while they were trained: a slider over the steps, and a button to
// play it.

const PLAY_MILLISECONDS = 120;

function makeEvolution(viewer) {
  const { evolution } = viewer.data;
  if (evolution.length < 2) return null;
  const { section, content } = panel("Junctions during training");
  section.id = "evolution";
  const last = evolution.length - 1;
  const words = (index) => `step ${evolution[index].step}, ${countOf(evolution[index].points.length, "junction")}`;
  const { row, input, output } = slider("Step", {
    min: 0, max: last, step: 1, value: last, words,
    oninput: (snapshot) => {
      stop();
      viewer.change({ snapshot });
    },
  });
  let timer = null;
  const stop = () => {
    clearInterval(timer);
    timer = null;
    play.textContent = "Play";
  };
  const goTo = (snapshot) => {
    input.value = snapshot;
    output.textContent = words(snapshot);
    input.setAttribute("aria-valuetext", words(snapshot));
    viewer.change({ snapshot });
  };
  const play = element("button", {
    type: "button", id: "play",
    onclick: () => {
      if (timer) return stop();
      play.textContent = "Pause";
      if (viewer.state.snapshot === null || viewer.state.snapshot === last) goTo(0);
      timer = setInterval(() => {
        if (viewer.state.snapshot >= last) stop();
        else goTo(viewer.state.snapshot + 1);
      }, PLAY_MILLISECONDS);
    },
  }, "Play");
  const result = element("button", {
    type: "button", id: "show-result", disabled: true,
    onclick: () => {
      stop();
      goTo(last);
      viewer.change({ snapshot: null });
    },
  }, "Back to the result");
  viewer.onChange((keys) => {
    if (keys.includes("snapshot")) result.disabled = viewer.state.snapshot === null;
  });
  content.append(row, element("div", { class: "buttons" }, play, result));
  return section;
}
