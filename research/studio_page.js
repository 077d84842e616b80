// What research/studio_page.py measures in the page of the studio.

// From the next event of a name until the first frame of the changed dance was drawn while the song played.
window.watch = (name) => {
  const { revision } = studio;
  performance.clearResourceTimings();
  window.measured = new Promise((done) => addEventListener(name, () => {
    const began = performance.now();
    const look = () => {
      const isShown = studio.shownRevision > revision && studio.shownRevision === studio.revision;
      if (!isShown || studio.playedSince < began) return requestAnimationFrame(look);
      const entries = performance.getEntriesByType("resource").filter((e) => e.startTime >= began - 1);
      const requests = entries.map((e) => [
        new URL(e.name).pathname, e.startTime - began, e.responseEnd - began, e.encodedBodySize]);
      const plays = studio.playedSince - began;
      done({ plays, requests: requests.filter((one) => one[2] <= plays) });
    };
    requestAnimationFrame(look);
  }, { capture: true, once: true }));
};

// Counts what is drawn: calls, triangles, points, and bytes that are sent for it.
window.count = () => {
  const kind = WebGL2RenderingContext.prototype;
  window.counted = { calls: 0, triangles: 0, points: 0, bytes: 0 };
  const add = (gl, mode, n) => {
    counted.calls += 1;
    if (mode === gl.POINTS) counted.points += n;
    else counted.triangles += mode === gl.TRIANGLES ? n / 3 : n - 2;
  };
  const { drawElements, drawArrays, bufferSubData } = kind;
  kind.drawElements = function (mode, n, ...more) {
    add(this, mode, n);
    drawElements.call(this, mode, n, ...more);
  };
  kind.drawArrays = function (mode, at, n) {
    add(this, mode, n);
    drawArrays.call(this, mode, at, n);
  };
  kind.bufferSubData = function (at, from, data) {
    counted.bytes += data.byteLength;
    bufferSubData.call(this, at, from, data);
  };
};

// Draws nothing from now on.
window.drawNothing = () => {
  const kind = WebGL2RenderingContext.prototype;
  for (const name of ["drawElements", "drawArrays", "clear"]) kind[name] = () => {};
};
