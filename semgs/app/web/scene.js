// Inside the page with the scene in 3D: does what the page around it asks for in messages, and reports clicks.
(() => {
  const { semgs } = window;
  const tell = (message) => window.parent.postMessage({ semgs: "scene", ...message }, "*");
  const report = (hit) => tell({ event: "click", hit });

  window.addEventListener("message", ({ data: message, source }) => {
    if (source !== window.parent || !message || message.semgs !== "room") return;
    if (message.fly !== undefined) semgs.fly(message.fly);
    if (message.back) semgs.goBack();
    if (message.near !== undefined) semgs.stayNear(message.near);
    if (message.marks) semgs.mark(message.marks);
    if (message.pick === "centre") report(semgs.pickCentre());
    if (message.state) tell({ event: "shown", ...semgs.show(message.state) });
  });
  semgs.load(JSON.parse(document.getElementById("semgs").textContent), () => {
    semgs.showPhotos(false);
    semgs.listen(report);
    tell({ event: "ready" });
  });
})();
