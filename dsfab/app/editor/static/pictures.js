/** Pictures by the server after each change, for browsers without WebGL. */

export class Pictures {
  /** canvas: hidden; image: element for the pictures; send(question): request a picture. */
  constructor(canvas, image, send) {
    Object.assign(this, { image, send, view: 'iso' });
    canvas.hidden = true;
    image.hidden = false;
  }

  ask(changes) {
    const { clientWidth, clientHeight } = this.image.parentElement;
    const size = [clientWidth, clientHeight].map((side) => Math.min(Math.max(Math.round(side), 64), 1600));
    this.send({ changes, view: this.view, show: 'structure', size });
  }

  look(view, changes) {
    this.view = view;
    this.ask(changes);
  }

  show({ state, result }) {
    if (state === 'done') this.image.src = `data:image/png;base64,${result.png}`;
  }
}
