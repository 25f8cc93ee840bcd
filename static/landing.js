// The parts of the landing page, put together.

import { offerThemes } from "./appearance.js";
import { offerCopies } from "./copy.js";
import { showGallery } from "./gallery.js";
import { showMeasurements } from "./measurements.js";
import { followRuns } from "./runs.js";
import { awaken, showScene, showTheme } from "./stage.js";

offerThemes(document.getElementById("theme"), showTheme);
offerCopies();
showScene();
await showGallery(); // first: it may name the scene to show
awaken();
showMeasurements();
followRuns();
